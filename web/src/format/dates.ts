/** Times as people read them: in the page's language, days by the place's time zone. */

const UNITS: [Intl.RelativeTimeFormatUnit, number][] = [
  ["year", 365.25 * 86400],
  ["month", 30.44 * 86400],
  ["day", 86400],
  ["hour", 3600],
  ["minute", 60],
];

/** How long ago, in the largest unit that fits at least one and a half times: "80 minutes ago", "5 hours ago". */
export function age(language: string, seconds: number): string {
  const words = new Intl.RelativeTimeFormat(language, { numeric: "auto" });
  for (const [unit, length] of UNITS) {
    const least = unit === "minute" ? length : 1.5 * length;
    if (Math.abs(seconds) >= least) return words.format(-Math.round(seconds / length), unit);
  }
  return words.format(0, "second");
}

export function duration(language: string, seconds: number): string {
  for (const [unit, length] of UNITS) {
    if (seconds >= 1.5 * length || unit === "minute") {
      return new Intl.NumberFormat(language, { style: "unit", unit, unitDisplay: "long" }).format(
        Math.round(seconds / length),
      );
    }
  }
  return "";
}

export function day(language: string, milliseconds: number, zone: string): string {
  return new Intl.DateTimeFormat(language, { weekday: "short", day: "numeric", month: "short", timeZone: zone }).format(
    milliseconds,
  );
}

/** How far a zone's clocks are ahead of UTC at a moment, seconds. */
function ahead(words: Intl.DateTimeFormat, seconds: number): number {
  const part = Object.fromEntries(words.formatToParts(seconds * 1000).map(({ type, value }) => [type, Number(value)]));
  const { year = 0, month = 1, day: of = 1, hour = 0, minute = 0, second = 0 } = part;
  return Date.UTC(year, month - 1, of, hour, minute, second) / 1000 - Math.floor(seconds);
}

const NUMBERS = { year: "numeric", month: "numeric", day: "numeric", hour: "numeric", minute: "numeric" } as const;

/** Midnights of a zone, `days` days apart, from the one before `from` to the first one behind `to`, seconds. A day at
 * whose border clocks change has 23 or 25 hours, or what its zone makes of it; one without a midnight begins with its
 * first moment. */
export function midnights(from: number, to: number, zone: string, days = 1): number[] {
  const words = new Intl.DateTimeFormat("en-GB", { ...NUMBERS, second: "numeric", hourCycle: "h23", timeZone: zone });
  const number = Math.floor((from + ahead(words, from)) / 86_400);
  const found: number[] = [];
  for (let local = number * 86_400; ; local += days * 86_400) {
    const before = local - ahead(words, local - 86_400);
    const after = local - ahead(words, local + 86_400);
    const ours = [before, after].filter((at) => at + ahead(words, at) === local);
    const at = ours.length > 0 ? Math.min(...ours) : before;
    found.push(at);
    if (at >= to) return found;
  }
}

/** A span of days, shortened where both lie in one month: "2 – 6 Dec". */
export function days(language: string, from: number, to: number, zone: string): string {
  return new Intl.DateTimeFormat(language, { day: "numeric", month: "short", timeZone: zone }).formatRange(from, to);
}

export function clock(language: string, milliseconds: number, zone: string): string {
  return new Intl.DateTimeFormat(language, { hour: "2-digit", minute: "2-digit", timeZone: zone }).format(milliseconds);
}

export function moment(language: string, milliseconds: number, zone: string): string {
  return new Intl.DateTimeFormat(language, {
    weekday: "short",
    day: "numeric",
    month: "short",
    hour: "2-digit",
    minute: "2-digit",
    timeZone: zone,
  }).format(milliseconds);
}

/** The clock alone where it was on the same day as `now`, else with the day. */
export function shortMoment(language: string, milliseconds: number, zone: string, now = Date.now()): string {
  const isToday = day(language, milliseconds, zone) === day(language, now, zone) && now - milliseconds < 86_400_000;
  return isToday ? clock(language, milliseconds, zone) : moment(language, milliseconds, zone);
}

export function fullMoment(language: string, milliseconds: number, zone: string): string {
  return new Intl.DateTimeFormat(language, { dateStyle: "medium", timeStyle: "short", timeZone: zone }).format(
    milliseconds,
  );
}
