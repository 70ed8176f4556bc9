/** The live connection: follows the server's events, and goes on after a lost link where it stopped. */
import { api } from "./client.ts";
import { backoff, type Event, parser } from "./stream.ts";

export type Link = "open" | "lost";

interface Listener {
  event: (event: Event) => void;
  link: (link: Link) => void;
  /** The server asks for a login. */
  denied: () => void;
}

// The server sends a comment at least every 15 s; silence beyond this is a dead link.
const SILENCE = 45_000;

/** Follows what comes behind the change `begin`, until the returned function is called. */
export function follow(begin: number, listener: Listener): () => void {
  let stopped = false;
  let last = String(begin);
  let tries = 0;
  let waking: (() => void) | null = null;
  let abort = new AbortController();

  const once = async () => {
    abort = new AbortController();
    const headers = { Accept: "text/event-stream", "Last-Event-ID": last };
    const response = await fetch(api("events"), { headers, cache: "no-store", signal: abort.signal });
    if (response.status === 401) return listener.denied();
    if (!response.ok || response.body === null) throw new Error(response.statusText);
    tries = 0;
    listener.link("open");
    const parse = parser((event) => {
      last = event.id ?? last;
      listener.event(event);
    });
    await read(response.body, parse, abort);
  };

  const loop = async () => {
    while (!stopped) {
      try {
        await once();
      } catch {
        // A lost link is told below, whatever its cause.
      }
      if (stopped) return;
      listener.link("lost");
      await new Promise<void>((wake) => {
        waking = wake;
        setTimeout(wake, backoff(tries));
      });
      tries += 1;
    }
  };

  const again = () => {
    tries = 0;
    waking?.();
  };
  window.addEventListener("online", again);
  void loop();
  return () => {
    stopped = true;
    window.removeEventListener("online", again);
    abort.abort();
    waking?.();
  };
}

async function read(body: ReadableStream<Uint8Array>, parse: (text: string) => void, abort: AbortController) {
  const reader = body.getReader();
  const decoder = new TextDecoder();
  for (;;) {
    const silent = setTimeout(() => abort.abort(), SILENCE);
    const { done, value } = await reader.read().finally(() => clearTimeout(silent));
    if (done) return;
    parse(decoder.decode(value, { stream: true }));
  }
}
