// REST calls of the service, with the token from the address of the page.

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
