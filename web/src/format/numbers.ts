/** Numbers and quantities as people read them, in the page's language. All values come in SI units. */

/** A value with its standard deviation, both written with the decimals that the deviation supports. */
export interface WithDeviation {
  value: string;
  deviation: string | null;
}

export function decimalsOf(deviation: number): number {
  if (!(deviation > 0)) return 1;
  const magnitude = Math.floor(Math.log10(deviation));
  const leading = deviation / 10 ** magnitude;
  // One significant digit, two where the first is a 1: 0.14 and 0.3, never 0.1 for 0.14.
  const digits = leading < 1.95 ? 1 : 0;
  return Math.min(4, Math.max(0, digits - magnitude));
}

export function number(language: string, value: number, decimals: number): string {
  return new Intl.NumberFormat(language, {
    minimumFractionDigits: decimals,
    maximumFractionDigits: decimals,
  }).format(value);
}

export function withDeviation(language: string, value: number, deviation: number | null): WithDeviation {
  if (deviation === null || !(deviation > 0)) return { value: number(language, value, 1), deviation: null };
  const decimals = decimalsOf(deviation);
  return { value: number(language, value, decimals), deviation: number(language, deviation, decimals) };
}

/** Kilograms as tonnes from one tonne on: the unit is chosen once for a silo, by its largest value. */
export function massUnit(kilograms: number): { unit: string; factor: number } {
  return Math.abs(kilograms) >= 1000 ? { unit: "t", factor: 0.001 } : { unit: "kg", factor: 1 };
}

export function mass(language: string, kilograms: number, deviation: number | null): WithDeviation & { unit: string } {
  const { unit, factor } = massUnit(kilograms);
  return { ...withDeviation(language, kilograms * factor, deviation === null ? null : deviation * factor), unit };
}

export function volume(language: string, cubicMetres: number, deviation: number | null) {
  return { ...withDeviation(language, cubicMetres, deviation), unit: "m³" };
}

export function percent(language: string, fraction: number, decimals = 0): string {
  return new Intl.NumberFormat(language, {
    style: "percent",
    minimumFractionDigits: decimals,
    maximumFractionDigits: decimals,
  }).format(fraction);
}

export function degrees(language: string, radians: number, decimals = 1): string {
  return `${number(language, (radians * 180) / Math.PI, decimals)}°`;
}

export function bytes(language: string, count: number): string {
  const units = ["byte", "kilobyte", "megabyte", "gigabyte", "terabyte"];
  const step = Math.min(units.length - 1, Math.max(0, Math.floor(Math.log10(Math.max(1, count)) / 3)));
  return new Intl.NumberFormat(language, {
    style: "unit",
    unit: units[step] ?? "byte",
    unitDisplay: "short",
    maximumSignificantDigits: 3,
  }).format(count / 1000 ** step);
}
