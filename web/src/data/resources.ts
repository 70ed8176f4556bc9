/** Answers of the service, kept in memory: shown at once, refreshed behind, never blanked by a failed refresh. */
import { useEffect, useReducer } from "preact/hooks";
import { get, Problem } from "./client.ts";

export interface Resource<T> {
  data: T | null;
  /** When `data` came, ms; null before the first answer. */
  at: number | null;
  /** Why the last refresh failed; `data` is then the one before. */
  problem: Problem | null;
}

interface Entry {
  resource: Resource<unknown>;
  etag: string | null;
  topics: string[];
  listeners: Set<() => void>;
  running: Promise<void> | null;
  stale: boolean;
}

const entries = new Map<string, Entry>();

function entry(path: string, topics: string[]): Entry {
  let found = entries.get(path);
  if (!found) {
    const resource = { data: null, at: null, problem: null };
    found = { resource, etag: null, topics, listeners: new Set(), running: null, stale: false };
    entries.set(path, found);
  }
  return found;
}

async function fetchOnce(path: string, one: Entry): Promise<void> {
  try {
    const { body, etag } = await get(path, one.etag);
    const data = body ?? one.resource.data;
    one.etag = etag;
    one.resource = { data, at: Date.now(), problem: null };
  } catch (error) {
    one.resource = { ...one.resource, problem: error instanceof Problem ? error : new Problem(0, String(error), null) };
  }
  for (const listener of one.listeners) listener();
  if (one.resource.problem?.noLink && one.listeners.size) setTimeout(() => void refresh(path), AGAIN);
}

/** After how long a resource that could not be reached is asked for again, ms. */
const AGAIN = 4000;

/** Fetches anew; a call during a fetch makes one more after it. */
export async function refresh(path: string): Promise<void> {
  const one = entries.get(path);
  if (!one) return;
  if (one.running) {
    one.stale = true;
    return one.running;
  }
  const run = async () => {
    do {
      one.stale = false;
      await fetchOnce(path, one);
    } while (one.stale);
    one.running = null;
  };
  one.running = run();
  return one.running;
}

/** Refreshes what a change concerns and somebody looks at; drops the rest, so that it is fetched when opened. */
export function changed(concerns: (topics: string[]) => boolean): void {
  for (const [path, one] of entries) {
    if (!concerns(one.topics)) continue;
    if (one.listeners.size) void refresh(path);
    else entries.delete(path);
  }
}

export const refreshAll = (): void => changed(() => true);

/** The resource at a path below `api/v1/`; null waits. `topics` name the changes that concern it. */
export function useResource<T>(path: string | null, ...topics: string[]): Resource<T> {
  const [, redraw] = useReducer((count: number) => count + 1, 0);
  const key = topics.join(" ");
  useEffect(() => {
    if (path === null) return;
    const one = entry(path, key.split(" "));
    one.listeners.add(redraw as () => void);
    if (one.resource.at === null || one.stale) void refresh(path);
    return () => {
      one.listeners.delete(redraw as () => void);
    };
  }, [path, key]);
  const known = path === null ? undefined : entries.get(path)?.resource;
  return (known ?? { data: null, at: null, problem: null }) as Resource<T>;
}

/** When the last answer came, ms; null before the first. */
export function newest(): number | null {
  const times = [...entries.values()].map((one) => one.resource.at).filter((at): at is number => at !== null);
  return times.length ? Math.max(...times) : null;
}
