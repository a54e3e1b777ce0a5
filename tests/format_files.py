"""Files of other programs: as the field has them, and broken ones."""

# A flame as the field has them: unused variations, colours, history, a post transform, a camera aside.
FLAME = """<?xml version="1.0"?>
<Flames name="pack">
<flame name="leaf &lt;1&gt;" time="3" size="640 640" center="0.1 -0.2" scale="160" zoom="0.5" palette="15">
  <xform weight="0.7" color="0" linear="0.95" coefs=".85 -.12 .14 .8 .1 -.3" spherical="0" chaos="1 1 1"/>
  <xform weight="2" color=".5" linear="1" coefs=".4 .3 -.3 .35 -.4 .2" post="1 0 .3 1 .1 0" plotmode="draw"/>
  <xform weight="1" color="1" symmetry="-.5" linear="1" coefs=".3 -.2 .3 .4 .5 .1" opacity="0.8"/>
  <color index="0" rgb="255 255 255"/><color index="255" rgb="255 200 200"/>
  <edit by="me" action="random"><edit><sheep generation="1" id="3"/></edit></edit>
</flame>
<flame size="640 320" scale="100">
  <xform weight="1" linear="1" coefs=".7 .2 -.2 .6 .3 0"/><xform weight="1" linear="1" coefs=".6 -.3 .2 .7 -.3 0"/>
  <color index="0" rgb="255 255 255"/><color index="255" rgb="200 255 200"/>
  <finalxform color="0" linear="1" coefs="0.9 0.4 -0.3 0.7 0.2 0.1" symmetry="1"/>
</flame>
<flame name="swirl"><xform weight="1" swirl="1" coefs="1 0 0 1 0 0"/></flame>
</Flames>
"""


def attributes(**values):
    return "".join(f' {key}="{value}"' for key, value in values.items())


def xform(tag="xform", **values):
    """An element of a contractive map with other attributes."""
    return f"<{tag}{attributes(**{'weight': 1, 'linear': 1, 'coefs': '.5 0 0 .5 .25 0'} | values)}/>"


def flame(*elements, **values):
    return f"<flame{attributes(**values)}>{''.join(elements)}</flame>"


BOMB = ('<!DOCTYPE f [<!ENTITY a "aaaaaaaaaa">' + "".join(f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip(
    "abcdefgh", "bcdefghi", strict=True)) + ']><flame name="&i;"/>')
BROKEN_FLAMES = [
    (BOMB, "declares a document type or an entity"),
    ('<!DOCTYPE f SYSTEM "file:///etc/passwd"><flame/>', "declares a document type"),
    ('<!DOCTYPE f [<!ENTITY x SYSTEM "file:///etc/passwd">]><flame name="&x;"/>', "declares a document type"),
    ('<!DOCTYPE f [<!ENTITY % x SYSTEM "http://localhost:1/x.dtd">%x;]><flame/>', "declares a document type"),
    ('<flame name="&x;"/>', "is not XML: undefined entity in line 1"),
    ("<a>" * 100_000, "nested more than 64 deep"), ("<flame>" + "<edit>" * 100_000, "nested more than 64 deep"),
    ("<flame>", "is not XML: no element found"), ("{}", "is not XML: not well-formed"), ("<fractal/>", "holds no code"),
    ("<flame><flame/></flame>", "a <flame> stands in another"),
    ("<flame/>", "flame: the code has no map"),
    ('<flame name="&lt;script>alert(1)&lt;/script>"/>', r"flame '<script>alert\(1\)</script>': the code has no map"),
    (flame(xform(), '<symmetry kind="0"/>'), "kind of symmetry must be a whole number other than 0, .* got '0'"),
    (flame(xform(), '<symmetry/>'), "got '0'; write 3 for three turns"),
    (flame(xform(), '<symmetry kind="2.5"/>'), "got '2.5'"),
    (flame(xform(), '<symmetry kind="-6000"/>'), "a code has from 1 to 10000 maps, got 12000"),
    (flame(xform(), '<symmetry kind="2"/>' * 2), "has a second <symmetry>"),
    (flame(xform(), xform(yzCoefs="1 0 0 1 .5 0")), "xform 2 moves points in space, by yzCoefs"),
    (flame(xform(), "<script>alert(1)</script>"), "has <script>, which a code cannot hold"),
    (flame('<xform linear="1"><motion/></xform>'), "has <motion>, which"),
    (flame(xform(), *[xform("finalxform")] * 2), "has a second <finalxform>"),
    (flame(xform(), xform("finalxform", coefs="1 1 1 1 0 0")), "finalxform flattens the picture"),
    (flame(xform(), xform("finalxform", spherical=1)), "finalxform has the variation or parameter 'spherical'"),
    (flame(xform(blur=0.1)), "xform 1 has the variation or parameter 'blur'; only 'linear' is affine"),
    (flame(xform(linear3D="x")), "linear3D of xform 1 must be a number, got 'x'"),
    (flame(xform(linear=0)), 'xform 1 has no variation; add linear="1"'),
    (flame(xform(chaos="1 0")), r"xform 1 has 'chaos' \(xaos\)"), (flame(xform(chaos="x")), "chaos of xform 1 must be"),
    (flame(xform(opacity=0)), "xform 1 is invisible"), (flame(xform(plotmode="off")), "xform 1 is invisible"),
    (flame('<xform weight="1" linear="1"/>'), "xform 1 has no coefs"),
    (flame(xform(coefs=".5 0 0 .5 NaN 0")), "coefs of xform 1 must be a number, got 'NaN'"),
    (flame(xform(coefs=".5 0 0 .5 1e999 0")), "coefs of xform 1 must be a finite number"),
    (flame(xform(coefs=".5 0 0 .5 1e39 0")), "offset must be finite"),
    (flame(xform(coefs="1e300 0 0 .5 0 0", post="1e300 0 0 1 0 0")), "linear must be finite"),
    (flame(xform(coefs=".5 0 0 .5 0")), "coefs of xform 1 must be 6 numbers, got '.5 0 0 .5 0'"),
    (flame(xform(post="1 0")), "post of xform 1 must be 6 numbers"),
    (flame(xform(coefs="1.5 0 0 .5 0 0")), "must be contractive.*map 1 has singular value 1.5; shrink"),
    (flame(xform(weight=0)), "weights must have a sum above 0"), (flame(xform(weight=-1)), "must have a sum above 0"),
    (flame(xform(), xform(weight="x")), "weight of xform 2 must be a number, got 'x'"),
    (flame(xform(), size="0 10"), "camera needs a size and a scale above 0"),
    (flame(xform(), zoom=1e9), "and a zoom below 100, got"),
    (flame(xform(), center="a b"), "center must be a number, got 'a'"),
]


# Typed after the examples of Fractint's and the IFS Construction Kit's documentation.
FRACTINT = """\
 This line is of no entry.

 fern { ; The classic  fern
        ; by M. Barnsley { with a brace }
    0    0    0  .16 0   0   .01   ; the stem
   .85  .04 -.04  .85 0  1.6 .85
   .2  -.26  .23  .22 0  1.6 .07
  -.15  .28  .26  .24 0  .44 .07
   }

3dfern (3D) { .00 .00 0 .0 .18 .0 0 0.0 0.00 0 0.0 0 1 }

comment { Anything may stand here, 1 2 three; even
 a semicolon. }

binary
 { ; the brace may come later
  .5  .0 .0 .5 -2.563477 -0.000003 .333333
  .5  .0 .0 .5  2.436544 -0.000003 .333333
  .0 -.5 .5 .0  4.873085  7.563492 .333333
 }
Levy {; without probabilities, with commas
   0.5, -0.5,  0.5,  0.5,  0,  0
   0.5,  0.5, -0.5,  0.5,  0.5,  0.5
}
Sierpinski Triangle {
   0.5  0  0  0.5  0  0  33
   0.5  0  0  0.5  0.5  0  33
   0.5  0  0  0.5  0.25  0.433  33 }
run { .5 0 0 .5 0 0 .25 .5 0 0 .5
 1e0 -0.0E+1 .75 }
"""
SPACE = " ".join(["0"] * 13)
BROKEN_FRACTINT = [
    ("fern { .5 0 0 .5 0 0", "entry 'fern' does not end; close it with '}'"),
    ("fern { .5 0 0 .5 0 0\ntree {\n.5 0 0 .5 0 0 }", "entry 'fern' has a second '{'"),
    ("fern { }", "entry 'fern': has 0 numbers"), ("fern {\n.5 0 0 .5 0\n}", "entry 'fern': has 5 numbers"),
    ("fern {\n.5 0 0 .5 0 0 1\n.5 0 0 .5 0 0\n}", "has 13 numbers; a map is a line of 6"),
    (f"fern {{\n{SPACE}\n{SPACE}\n}}", "has 13 numbers a map, as codes in space do"),
    ("fern { .5 0 0 .5 0 nan }", "number 6 of map 1 must be a number, got 'nan'"),
    ("fern { .5 0 0 .5 0 1_0 }", "number 6 of map 1 must be a number, got '1_0'"),
    ("fern { .5 0 0 .5 0 1e999 }", "number 6 of map 1 must be a finite number"),
    ("fern { .5 0 0 .5 0 1e39 }", "offset must be finite"),
    ("fern { 1.5 0 0 .5 0 0 }", "entry 'fern': .* must be contractive.*map 1 has singular value 1.5"),
    ("fern { .5 0 0 .5 0 0 0 }", "weights must have a sum above 0"),
    ("fern { .5 0 0 .5 0 0 1 .5 0 0 .5 0 0 x }", "number 7 of map 2 must be a number, got 'x'"),
    ("fern { .5 0 0 .5 0 0 1e308 .5 0 0 .5 0 0 1e308 }", "weights must have a sum above 0 that is not huge"),
    ("fern {\n 0,5 0 0 0,5 0 0 1\n}", "number 1 of map 1 .*, got '0,5'; write a point for a decimal comma"),
    ("fern {\n 0,5 0 0 1 0 0\n}", "number 1 of map 1 must be a number, got '0,5'"),
    ("no entry", "the table: number 1 of map 1 must be a number, got 'no'"), ("# 3 maps\n", "the table: has 0 numbers"),
    ("4\n.5 0 0 .5 0 0\n", "the table: the first line is '4', and 1 maps follow"),
    ("0.5 0 0 .5 0 0\n.5 0 0 .5 0 0 0\n", "has 13 numbers; a map is a line of 6"),
    ("0.5 ; 0 ; 0 ; .5 ; 0 ; 0\n" * 7, "has 7 numbers; a map is a line of 6"),
    ("0,5;0;0;0,5;0;0\n", "number 1 of map 1 must be a number, got '0,5'"),
    ("a b c d e e p\n.5 0 0 .5 0 0 1\n", "an order of columns names a, b, c, d, e and f once each"),
    (".5\0", "the file is no text, as it has the character 0"),
    ("}{}", "entry '': has 0 numbers"), ("comment {fern}", "holds no code"),
    ("; fern { .5 0 0 .5 0 0 }", "holds no code"),
    ("<script>\x1b[31m { x }", r"entry '<script>\[31m': number 1 of map 1 must be a number, got 'x'"),
]
