/** The tree of places: pure functions. */
import type { Place, Rule, Silo } from "../data/answers.ts";

export interface Branch {
  place: Place;
  /** Silos in it and below it. */
  count: number;
  below: Branch[];
}

export function branches(places: Place[], silos: Silo[], parent: string | null = null): Branch[] {
  const known = new Set(places.map((place) => place.id));
  const isHere = (place: Place) =>
    parent === null ? place.parent === null || !known.has(place.parent) : place.parent === parent;
  return places
    .filter(isHere)
    .map((place) => ({
      place,
      count: silos.filter((silo) => within(places, silo.place, place.id)).length,
      below: branches(places, silos, place.id),
    }))
    .sort((a, b) => a.place.name.localeCompare(b.place.name));
}

/** Whether a place is another one or lies in it. */
export function within(places: Place[], inner: string | null, outer: string): boolean {
  const parents = new Map(places.map((place) => [place.id, place.parent]));
  const passed = new Set<string>();
  for (let at = inner; at !== null && !passed.has(at); at = parents.get(at) ?? null) {
    if (at === outer) return true;
    passed.add(at);
  }
  return false;
}

/** The rules for a silo: of each kind the one that names it, else that of the nearest place around it, else the site's. */
export function inForce(rules: Rule[], silo: Pick<Silo, "id" | "place">, places: Place[]): Rule[] {
  const around: (string | null)[] = [];
  for (let at = silo.place; at !== null && !around.includes(at); ) {
    around.push(at);
    at = places.find((place) => place.id === at)?.parent ?? null;
  }
  const far = (rule: Rule) =>
    rule.silo === null ? [...around, null].indexOf(rule.place) : rule.silo === silo.id ? -1 : -2;
  const best = new Map<string, Rule>();
  for (const rule of rules.filter((one) => far(one) > -2 && (one.silo !== null || far(one) > -1))) {
    const before = best.get(rule.kind);
    if (!before || far(rule) < far(before)) best.set(rule.kind, rule);
  }
  return [...best.values()];
}
