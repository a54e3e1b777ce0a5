// The line to the studio: what it tells, what it is asked for, and pictures that are sent to it.

const AGAIN = 1000; // ms until a line that broke is tried again

/** A WebSocket that is opened anew whenever it breaks. heard: called with each word; line: with whether it is open. */
export class Channel {
  constructor(heard, line) {
    Object.assign(this, { heard, line });
    this.open();
  }

  open() {
    const address = new URL("live", location.href);
    address.protocol = "ws:";
    this.socket = new WebSocket(address);
    this.socket.addEventListener("open", () => this.line(true, ""));
    this.socket.addEventListener("message", ({ data }) => this.heard(JSON.parse(data)));
    this.socket.addEventListener("close", ({ reason }) => {
      this.line(false, reason);
      setTimeout(() => this.open(), AGAIN);
    });
  }

  /** Ask for something; whether it could be sent. */
  ask(act, more = {}) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify({ do: act, ...more }));
    return true;
  }

  /** Send a picture, and return why it was refused, or nothing. */
  async send(file) {
    const address = new URL("picture", location.href);
    address.searchParams.set("name", file.name ?? "pasted");
    try {
      const answer = await fetch(address, { method: "POST", body: file });
      return (await answer.json()).why;
    } catch {
      return "The studio did not take the picture: it is too large, or the studio has ended";
    }
  }
}
