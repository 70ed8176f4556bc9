/** The page's texts. English is in the main file, the other languages are loaded when chosen. */
import { createContext } from "preact";
import { useContext } from "preact/hooks";
import { en } from "./en.ts";
import { fill } from "./fill.ts";

export type Key = keyof typeof en;
export type Texts = Record<Key, string>;
export type Language = "en" | "es" | "ca" | "de";

export const LANGUAGES: Record<Language, string> = { en: "English", es: "Español", ca: "Català", de: "Deutsch" };

const LOADERS: Record<Language, () => Promise<Texts>> = {
  en: async () => en,
  es: async () => (await import("./es.ts")).es,
  ca: async () => (await import("./ca.ts")).ca,
  de: async () => (await import("./de.ts")).de,
};

export const load = (language: Language): Promise<Texts> => LOADERS[language]();

export interface Words {
  language: Language;
  /** Browser's locale of that language where it has one ("de-AT"), for dates and numbers. */
  locale: string;
  t: (key: Key, values?: Record<string, string | number>) => string;
  /** Text of a key that the server names (an event's kind, an alert's kind); the bare name where there is none. */
  named: (family: string, name: string) => string;
}

export function words(language: Language, texts: Texts): Words {
  const locale = localeOf(language);
  const t: Words["t"] = (key, values) => fill(locale, texts[key], values);
  const named: Words["named"] = (family, name) => texts[`${family}.${name}` as Key] ?? name.replace(/[-_]/g, " ");
  return { language, locale, t, named };
}

function localeOf(language: Language): string {
  return navigator.languages.find((tag) => tag.split("-")[0] === language) ?? (language === "en" ? "en-GB" : language);
}

const REMEMBERED = "siloscope.language";

export function preferred(): Language {
  const wanted = [localStorage.getItem(REMEMBERED), ...navigator.languages.map((tag) => tag.split("-")[0])];
  return (wanted.find((tag) => tag !== undefined && tag !== null && tag in LANGUAGES) as Language | undefined) ?? "en";
}

export const remember = (language: Language): void => localStorage.setItem(REMEMBERED, language);

export const WordsContext = createContext<Words>(words("en", en));
export const useWords = (): Words => useContext(WordsContext);
