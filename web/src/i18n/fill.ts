/** Fills `{name}` in a text. A form `{n|one|other}` is chosen by the language's plural rule of `n`. */
export function fill(language: string, text: string, values: Record<string, string | number> = {}): string {
  return text.replace(/\{(\w+)(?:\|([^|}]*)\|([^}]*))?\}/g, (whole, name: string, one?: string, other?: string) => {
    const value = values[name];
    if (value === undefined) return whole;
    if (one === undefined || other === undefined) return String(value);
    const plain = new Intl.PluralRules(language).select(Number(value)) === "one" ? one : other;
    return plain.replace("#", String(value));
  });
}
