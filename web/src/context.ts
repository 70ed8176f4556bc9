/** What every part of the page may ask: who looks, what time it is, whether the link holds. */
import { createContext } from "preact";
import { useContext, useEffect, useState } from "preact/hooks";
import type { Alert, PageOf, Site } from "./data/answers.ts";
import type { Link } from "./data/live.ts";
import { useResource } from "./data/resources.ts";

export type Role = "percent" | "viewer" | "operator" | "admin";

export interface Surroundings {
  site: Site;
  link: Link;
  /** Signs out. */
  leave: () => void;
}

export const SurroundingsContext = createContext<Surroundings | null>(null);

export function useSurroundings(): Surroundings {
  const found = useContext(SurroundingsContext);
  if (found === null) throw new Error("outside the page");
  return found;
}

const ORDER: Role[] = ["percent", "viewer", "operator", "admin"];
export const atLeast = (role: string | null, wanted: Role): boolean =>
  ORDER.indexOf(role as Role) >= ORDER.indexOf(wanted);

export const FIRING = "alerts?state=firing&count=500";

/** What is firing now, anywhere. */
export const useFiring = (): Alert[] => useResource<PageOf<Alert>>(FIRING, "alert").data?.items ?? [];

/** The time, ms, anew every half minute, so that ages grow while nothing comes. */
export function useNow(): number {
  const [now, setNow] = useState(Date.now);
  useEffect(() => {
    const timer = setInterval(() => setNow(Date.now()), 30_000);
    return () => clearInterval(timer);
  }, []);
  return now;
}
