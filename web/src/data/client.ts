/** Requests to the service: relative to the document, with its session cookie, problems as errors. */

/** What went wrong, as the server says it (RFC 9457), or "no link" where nothing answered. */
export class Problem extends Error {
  constructor(
    readonly status: number,
    readonly title: string,
    readonly detail: string | null,
  ) {
    super(detail ?? title);
  }

  /** The server could not be reached, or a proxy in front of it could not. */
  get noLink(): boolean {
    return this.status === 0 || this.status === 502 || this.status === 503 || this.status === 504;
  }
}

const TIMEOUT = 15_000;

export const address = (path: string): string => new URL(path, document.baseURI).href;
export const api = (path: string): string => address(`api/v1/${path}`);

/** Answer of a resource; `null` body where it is unchanged since the version that `etag` names. */
export async function get<T>(
  path: string,
  etag: string | null = null,
): Promise<{ body: T | null; etag: string | null }> {
  const response = await send(path, { headers: etag === null ? {} : { "If-None-Match": etag } });
  if (response.status === 304) return { body: null, etag };
  return { body: (await response.json()) as T, etag: response.headers.get("ETag") };
}

/** Changes something; `If-Match` with an etag where two people may edit. */
export async function change<T>(method: string, path: string, body?: unknown, etag?: string | null): Promise<T | null> {
  const headers: Record<string, string> = { "Content-Type": "application/json" };
  if (etag) headers["If-Match"] = etag;
  const content = body === undefined ? {} : { body: JSON.stringify(body) };
  const response = await send(path, { method, headers, ...content });
  return response.status === 204 ? null : ((await response.json()) as T);
}

async function send(path: string, options: RequestInit): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(api(path), {
      credentials: "same-origin",
      cache: "no-store",
      signal: AbortSignal.timeout(TIMEOUT),
      ...options,
    });
  } catch {
    throw new Problem(0, "no link", null);
  }
  if (!response.ok && response.status !== 304) throw await problemOf(response);
  return response;
}

async function problemOf(response: Response): Promise<Problem> {
  try {
    const { title, detail } = (await response.json()) as { title?: string; detail?: string };
    return new Problem(response.status, title ?? response.statusText, detail ?? null);
  } catch {
    return new Problem(response.status, response.statusText, null);
  }
}
