// WebSocket connection to the service, with automatic reconnection.

import { callService, addressWithToken } from "../web/api.js";

const MIN_RETRY_DELAY = 500, MAX_RETRY_DELAY = 4000; // [ms]
const MESSAGE_TIMEOUT = 4000; // [ms]; a WebSocket does not notice an unplugged cable
const SCHEMA = "holdfast.live/1";

// A browser cannot add headers to a WebSocket, so the token is in its address.
function liveAddress() {
  const url = addressWithToken("api/v1/live");
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  return url.href;
}

export class Connection {
  /**
   * @param handlers {hello(message), live(message), state(state, reason)}; the state is
   *   "connecting", "open", "lost" or "refused".
   */
  constructor(handlers) {
    this.handlers = handlers;
    this.retryDelay = MIN_RETRY_DELAY;
    this.sourceEnded = false;
    this.lastMessageAt = 0;
    this.connect();
    setInterval(() => this.checkTimeout(), 1000);
  }

  connect() {
    this.socket = new WebSocket(liveAddress());
    this.lastMessageAt = performance.now();
    this.socket.addEventListener("message", (event) => this.receive(event.data));
    this.socket.addEventListener("close", () => this.reconnect());
  }

  receive(text) {
    this.lastMessageAt = performance.now();
    let message;
    try {
      message = JSON.parse(text);
    } catch {
      return; // the next message arrives in 50 ms
    }
    if (message.type === "hello") this.receiveHello(message);
    else if (message.type === "live") {
      this.sourceEnded = Boolean(message.ended);
      this.handlers.live(message);
    }
  }

  receiveHello(message) {
    if (message.schema !== SCHEMA) {
      this.handlers.state("refused", `the service uses ${message.schema}, this page ${SCHEMA}: reload the page`);
      return;
    }
    this.retryDelay = MIN_RETRY_DELAY;
    this.sourceEnded = false;
    this.handlers.state("open", "");
    this.handlers.hello(message);
  }

  async reconnect() {
    const socket = this.socket;
    this.handlers.state("lost", "");
    // A WebSocket does not report why it was refused; a plain request does.
    const refusal = await callService("GET", "info").then(() => null, (error) => error);
    if (socket !== this.socket) return;
    if (refusal?.status === 401 || refusal?.status === 403) {
      this.handlers.state("refused", "the service needs its token: open the address that it printed");
    }
    setTimeout(() => this.connect(), this.retryDelay);
    this.retryDelay = Math.min(MAX_RETRY_DELAY, 2 * this.retryDelay);
  }

  checkTimeout() {
    // A source that has ended may be silent.
    if (this.sourceEnded || performance.now() - this.lastMessageAt < MESSAGE_TIMEOUT) return;
    if (this.socket.readyState === WebSocket.OPEN) this.socket.close();
  }
}
