// Connection to the service, with the token from the address of the page: calls, and a stream of
// documents that is connected again when it is lost.

const MIN_RETRY_DELAY = 500, MAX_RETRY_DELAY = 4000; // [ms]
const MESSAGE_TIMEOUT = 4000; // [ms]; a WebSocket does not notice an unplugged cable

const token = new URLSearchParams(window.location.search).get("token");

// Relative to the page, so that it also works behind a proxy under another path.
const address = (path) => new URL(path, document.baseURI);

/** Return an address that contains the token, for requests without our headers. */
export function addressWithToken(path) {
  const url = address(path);
  if (token !== null) url.searchParams.set("token", token);
  return url;
}

/** Call the service; throw an Error with the message of the service if it refuses. */
export async function callService(method, path, body) {
  const headers = token === null ? {} : { Authorization: `Bearer ${token}` };
  if (body !== undefined) headers["Content-Type"] = "application/json";
  let response;
  try {
    response = await fetch(address(`api/v1/${path}`), {
      method, headers, cache: "no-store",
      body: body === undefined ? undefined : JSON.stringify(body),
    });
  } catch {
    throw Object.assign(new Error("the service does not answer"), { status: 0 });
  }
  const answer = await response.json().catch(() => null);
  if (response.ok && answer) return answer;
  const reason = answer?.error ?? (response.status === 401
    ? "the service needs its token: add ?token=… to the address"
    : `the service answered ${response.status}`);
  throw Object.assign(new Error(reason), { status: response.status });
}

/** Stream of documents of a service. */
export class Connection {
  /**
   * @param path of the stream; a browser cannot add headers to it, so the token is in its address.
   * @param schema of its documents.
   * @param handlers {hello(message), live(message), state(state, reason)}; the state is
   *   "connecting", "open", "lost" or "refused".
   */
  constructor(path, schema, handlers) {
    Object.assign(this, { schema, handlers, retryDelay: MIN_RETRY_DELAY, sourceEnded: false });
    this.url = addressWithToken(path);
    this.url.protocol = this.url.protocol.replace("http", "ws");
    this.connect();
    setInterval(() => this.checkTimeout(), 1000);
  }

  connect() {
    this.socket = new WebSocket(this.url.href);
    this.lastMessageAt = performance.now();
    this.socket.addEventListener("message", (event) => this.receive(JSON.parse(event.data)));
    this.socket.addEventListener("close", () => this.reconnect());
  }

  receive(message) {
    this.lastMessageAt = performance.now();
    this.sourceEnded = Boolean(message.ended);
    if (message.type === "live") this.handlers.live(message);
    if (message.type !== "hello") return;
    if (message.schema !== this.schema) {
      this.handlers.state("refused", `the service uses ${message.schema}, this page ${this.schema}: reload the page`);
      return;
    }
    this.retryDelay = MIN_RETRY_DELAY;
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
