// The connection to the service: it comes back by itself, and says how it is.

import { callService, addressWithToken } from "../web/api.js";

const SHORTEST = 500, LONGEST = 4000; // [ms] between attempts
const PATIENCE = 4000; // [ms] without a message: a cable that was pulled closes nothing
const SCHEMA = "holdfast.live/1";

// A browser cannot give a WebSocket headers, so the token is in its address.
function liveAddress() {
  const url = addressWithToken("api/v1/live");
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  return url.href;
}

export class Feed {
  /**
   * @param on {hello(message), live(message), link(state, text)}; the state of the link is
   *   "connecting", "open", "lost" or "refused".
   */
  constructor(on) {
    this.on = on;
    this.wait = SHORTEST;
    this.ended = false;
    this.heard = 0;
    this.connect();
    setInterval(() => this.watch(), 1000);
  }

  connect() {
    this.socket = new WebSocket(liveAddress());
    this.heard = performance.now();
    this.socket.addEventListener("message", (event) => this.take(event.data));
    this.socket.addEventListener("close", () => this.lost());
  }

  take(text) {
    this.heard = performance.now();
    let message;
    try {
      message = JSON.parse(text);
    } catch {
      return; // the next one comes in 50 ms
    }
    if (message.type === "hello") this.greet(message);
    else if (message.type === "live") {
      this.ended = Boolean(message.ended);
      this.on.live(message);
    }
  }

  greet(message) {
    if (message.schema !== SCHEMA) {
      this.on.link("refused", `the service speaks ${message.schema}, this page ${SCHEMA}: reload it`);
      return;
    }
    this.wait = SHORTEST;
    this.ended = false;
    this.on.link("open", "");
    this.on.hello(message);
  }

  async lost() {
    const socket = this.socket;
    this.on.link("lost", "");
    // A WebSocket does not tell why it was refused; a plain request does.
    const refused = await callService("GET", "info").then(() => null, (error) => error);
    if (socket !== this.socket) return;
    if (refused?.status === 401 || refused?.status === 403) {
      this.on.link("refused", "the service wants its token: open the address that it printed");
    }
    setTimeout(() => this.connect(), this.wait);
    this.wait = Math.min(LONGEST, 2 * this.wait);
  }

  watch() {
    // After its end a source may well be silent.
    if (this.ended || performance.now() - this.heard < PATIENCE) return;
    if (this.socket.readyState === WebSocket.OPEN) this.socket.close();
  }
}
