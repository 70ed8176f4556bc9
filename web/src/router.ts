/** Where the page is: the part of the address behind `#`, so that it works below any path. */
import { useEffect, useState } from "preact/hooks";

export type Route =
  | { view: "silos"; place: string | null }
  | { view: "silo"; silo: string; tab: Tab }
  | { view: "alerts" }
  | { view: "cameras" }
  | { view: "settings" }
  | { view: "welcome"; secret: string }
  | { view: "install"; camera: string };

export const TABS = ["events", "tickets", "calibration", "rules", "settings"] as const;
export type Tab = (typeof TABS)[number];

export function parse(hash: string): Route {
  const [view = "", name = "", tab = ""] = partsOf(hash);
  if (view === "silos" && name) return { view: "silo", silo: name, tab: TABS.find((one) => one === tab) ?? "events" };
  if (view === "install" && name) return { view: "install", camera: name };
  if (view === "places" && name) return { view: "silos", place: name };
  if (view === "alerts" || view === "settings" || view === "cameras") return { view };
  return { view: "silos", place: null };
}

function partsOf(hash: string): string[] {
  try {
    return hash
      .replace(/^#?\/?/, "")
      .split("/")
      .map(decodeURIComponent);
  } catch {
    return []; // a % that begins no character
  }
}

export const link = {
  silos: (place?: string | null) => (place ? `#/places/${encodeURIComponent(place)}` : "#/"),
  silo: (silo: string, tab?: Tab) => `#/silos/${encodeURIComponent(silo)}${tab ? `/${tab}` : ""}`,
  alerts: "#/alerts",
  cameras: "#/cameras",
  settings: "#/settings",
  install: (camera: string) => `#/install/${encodeURIComponent(camera)}`,
};

/** The first user's link is `/welcome#<secret>`: the server never sees what is behind `#`. */
const here = (): Route =>
  /\/welcome\/?$/.test(window.location.pathname)
    ? { view: "welcome", secret: window.location.hash.slice(1) }
    : parse(window.location.hash);

export function useRoute(): Route {
  const [route, setRoute] = useState(here);
  useEffect(() => {
    const moved = () => setRoute(here());
    window.addEventListener("hashchange", moved);
    return () => window.removeEventListener("hashchange", moved);
  }, []);
  return route;
}
