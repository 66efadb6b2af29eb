// The service's REST calls, and the token that the page's own address may carry.

export const token = new URLSearchParams(window.location.search).get("token");

// Relative to the page, so that it works behind a proxy under another path too.
const address = (path) => new URL(`api/v1/${path}`, document.baseURI);

/** The address of the live WebSocket; a browser cannot give it headers. */
export function liveAddress() {
  const url = address("live");
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  if (token !== null) url.searchParams.set("token", token);
  return url.href;
}

/** Calls the service; throws an Error with the service's own words where it refuses. */
export async function call(method, path, body) {
  const headers = token === null ? {} : { Authorization: `Bearer ${token}` };
  if (body !== undefined) headers["Content-Type"] = "application/json";
  let response;
  try {
    response = await fetch(address(path), {
      method, headers, cache: "no-store",
      body: body === undefined ? undefined : JSON.stringify(body),
    });
  } catch {
    throw new Error("the service does not answer");
  }
  const answer = await response.json().catch(() => ({}));
  if (response.ok) return answer;
  throw Object.assign(new Error(answer?.error ?? `the service answered ${response.status}`), {
    status: response.status,
  });
}
