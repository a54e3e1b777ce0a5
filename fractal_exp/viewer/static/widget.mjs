// A code in a notebook: the page in a sandboxed frame. Codes go between it and the model, which the kernel shares.
// anywidget loads this module alone, so it imports nothing.

const READY = "fractal-exp/ready", CODE = "fractal-exp/code"; // kinds of messages, in notebook.mjs too

export default {
  render({ model, el }) {
    const frame = document.createElement("iframe");
    let known = null; // the code that the page has, as text

    const resize = () => { frame.style.height = `${model.get("height")}px`; };
    const show = () => {
      const code = model.get("code"), text = JSON.stringify(code);
      if (text === known) return;
      known = text;
      frame.contentWindow?.postMessage({ kind: CODE, code }, "*"); // a sandboxed frame has no address to name
    };
    const receive = ({ source, data }) => {
      if (!source || source !== frame.contentWindow) return;
      if (data?.kind === READY) {
        known = null; // a frame that is moved in a notebook loads its page again
        show();
      } else if (data?.kind === CODE && data.code !== null && typeof data.code === "object") {
        known = JSON.stringify(data.code);
        model.set("code", data.code);
        model.save_changes();
      }
    };

    frame.sandbox = "allow-scripts";
    frame.title = "A fractal to fly into and to edit";
    frame.style.cssText = "display: block; width: 100%; border: 0; border-radius: 8px";
    frame.srcdoc = model.get("_page");
    resize();
    addEventListener("message", receive);
    model.on("change:code", show);
    model.on("change:height", resize);
    el.append(frame);
    return () => {
      removeEventListener("message", receive);
      model.off("change:code", show);
      model.off("change:height", resize);
    };
  },
};
