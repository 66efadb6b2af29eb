// The service's REST calls, and the token that the page's own address may carry.

const token = new URLSearchParams(window.location.search).get("token");

// Relative to the page, so that it works behind a proxy under another path too.
const address = (path) => new URL(path, document.baseURI);

/** An address with the token inside, for what the browser asks for without our headers. */
export function addressWithToken(path) {
  const url = address(path);
  if (token !== null) url.searchParams.set("token", token);
  return url;
}

/** Calls the service; throws an Error with the service's own words where it refuses. */
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
  const why = answer?.error ?? (response.status === 401 ? "the service wants its token: ?token=… in the address" : `the service answered ${response.status}`);
  throw Object.assign(new Error(why), { status: response.status, revision: answer?.revision });
}
