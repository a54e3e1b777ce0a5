// The programs of the GPU, in GLSL.

export const ACROSS = 64; // words in a row of their texture
export const TEXELS = 3; // of a word: the matrix, the shift, and what it makes of a colour

const throwing = (coloured) => `#version 300 es
layout(location = 0) in vec2 point;
layout(location = 1) in uint slot;
${coloured ? "layout(location = 2) in vec4 shade;\nout vec3 ink;" : ""}
uniform highp sampler2D words;
void main() {
  int word = int(slot);
  ivec2 at = ivec2(${TEXELS} * (word % ${ACROSS}), word / ${ACROSS});
  vec4 linear = texelFetch(words, at, 0), shift = texelFetch(words, at + ivec2(1, 0), 0);
  gl_Position = vec4(linear.xy * point.x + linear.zw * point.y + shift.xy, 0.0, 1.0);
  gl_PointSize = 1.0;
  ${coloured ? "vec4 fold = texelFetch(words, at + ivec2(2, 0), 0);\n  ink = fold.x * shade.rgb + fold.yzw;" : ""}
}`;
export const THROW = throwing(false);
export const THROW_IN_COLOUR = throwing(true);
export const LIGHT = `#version 300 es
precision mediump float;
out vec4 colour;
void main() { colour = vec4(1.0); }`;
export const TINT = `#version 300 es
precision highp float;
in vec3 ink;
out vec4 colour;
void main() { colour = vec4(ink, 1.0); }`;
export const COVER = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0.0, 1.0); }`;
const HEAD = `#version 300 es
precision highp float;
uniform highp sampler2D canvas;
uniform int level;
uniform float done, scale;
uniform bool byHand;
uniform vec3 ground;
out vec4 colour;
ivec2 place(ivec2 size) { // what is thrown by hand has its first row on top
  ivec2 at = ivec2(gl_FragCoord.xy);
  return ivec2(at.x, byHand ? size.y - 1 - at.y : at.y);
}`;
// With a share f of the points thrown, a share s of a pixel's subpixels is lit; with all of them it will be about
// 1 - (1 - s)^(1/f), so that a picture does not grow brighter while it grows sharper.
export const SHOW = `${HEAD}
uniform vec3 ink;
void main() {
  ivec2 size = textureSize(canvas, level), at = place(size);
  float lit = min(1.0, scale * texelFetch(canvas, min(at, size - 1), level).r);
  colour = vec4(mix(ground, ink, 1.0 - pow(1.0 - lit, 1.0 / done)), 1.0);
}`;
// A subpixel has the colour of its last point. They are added up here, because a mipmap of many levels would round the
// colours of a pixel with few points away.
export const SHOW_COLOUR = `${HEAD}
uniform int side;
void main() {
  ivec2 size = textureSize(canvas, level), at = place(size / side) * side;
  vec4 sum = vec4(0.0);
  for (int r = 0; r < side; r++)
    for (int c = 0; c < side; c++) sum += texelFetch(canvas, min(at + ivec2(c, r), size - 1), level);
  sum /= float(side * side);
  float lit = min(1.0, scale * sum.a);
  vec3 own = byHand ? sum.rgb : sum.rgb / max(sum.a, 1e-6);
  colour = vec4(mix(ground, own, 1.0 - pow(1.0 - lit, 1.0 / done)), 1.0);
}`;
// The tone of a code that was found on a density, softened as in the package.
const TONED = `uniform float mean, exposure, gamma;
uniform bool linear;
vec4 softened(ivec2 at, ivec2 size) {
  vec4 sum = vec4(0.0);
  for (int r = -1; r <= 1; r++)
    for (int c = -1; c <= 1; c++) {
      float share = (r == 0 ? 0.75 : 0.125) * (c == 0 ? 0.75 : 0.125);
      sum += share * texelFetch(canvas, clamp(at + ivec2(c, r), ivec2(0), size - 1), 0);
    }
  return sum;
}
float toned(float count) {
  float d = exposure * count / mean;
  return pow(linear ? min(1.0, d) : 1.0 - exp(-d), 1.0 / gamma);
}`;
// Sums of the colours of a pixel's points, and their number, whose tone is the opacity.
export const SHOW_TINTED = `${HEAD}
${TONED}
void main() {
  ivec2 size = textureSize(canvas, 0), at = place(size);
  vec4 sum = softened(at, size);
  colour = vec4(mix(ground, sum.rgb / max(sum.a, 1e-6), toned(sum.a)), 1.0);
}`;
// The density is that of `render`: the points of a pixel over their mean. Its logarithm against that of `white`, to the
// power 1/tone, is the place on the palette; a pixel of few points is partly ground. With a gamma, the code's own tone
// makes it ink.
export const showDensity = (stops) => `${HEAD}
${TONED}
uniform float white, tone;
uniform vec3 ink, palette[${stops}];
void main() {
  ivec2 size = textureSize(canvas, 0), at = place(size);
  float count = texelFetch(canvas, at, 0).r;
  if (gamma > 0.0) {
    colour = vec4(mix(ground, ink, toned(softened(at, size).r)), 1.0);
    return;
  }
  float along = pow(min(1.0, log(1.0 + count / mean) / log(1.0 + white)), 1.0 / tone) * ${stops - 1}.0;
  int k = min(int(along), ${stops - 2});
  vec3 own = mix(palette[k], palette[k + 1], along - float(k));
  colour = vec4(mix(ground, own, 1.0 - exp(-2.0 * count / done)), 1.0);
}`;
