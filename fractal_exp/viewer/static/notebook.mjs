// The page's end of the line to a notebook. At the other end is the widget in whose frame the page lies (widget.mjs).

import { Refused } from "./code.mjs";
import { codeOf, writeJson } from "./json.mjs";

const READY = "fractal-exp/ready", CODE = "fractal-exp/code"; // kinds of messages, in widget.mjs too
const EVERY = 100; // ms between the codes of a map that is dragged

/** Exchanges codes with the window around this page. show(code, first) takes a code from there; refuse(why) is told of
 * one that cannot be shown. */
export class Notebook {
  constructor({ show, refuse }) {
    Object.assign(this, { show, refuse, known: null, code: null, timer: 0 });
    addEventListener("message", ({ source, data }) => {
      if (source === parent && data?.kind === CODE) this.receive(data.code);
    });
    post({ kind: READY });
  }

  receive(data) {
    try {
      const code = codeOf(data), text = writeJson(code), first = this.known === null;
      if (text === this.known) return;
      this.known = text;
      this.show(code, first);
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      this.refuse(`The notebook's code is refused: ${error.message}`);
    }
  }

  /** Send a code, or a later one that comes within EVERY; not one that the notebook has. */
  send(code) {
    this.code = code;
    this.timer ||= setTimeout(() => {
      this.timer = 0;
      const text = writeJson(this.code);
      if (text === this.known) return;
      this.known = text;
      post({ kind: CODE, code: JSON.parse(text) });
    }, EVERY);
  }
}

/** A sandboxed page cannot know the address of the window around it, so none is named. */
function post(message) {
  parent.postMessage(message, "*");
}
