/** Light or dark: the person's choice where there is one, else the system's. The style sheet goes by `data-theme`. */
import { useEffect, useState } from "preact/hooks";

export const THEMES = ["auto", "light", "dark"] as const;
export type Theme = (typeof THEMES)[number];

const REMEMBERED = "siloscope.theme";
const system = matchMedia("(prefers-color-scheme: dark)");

export const chosen = (): Theme => THEMES.find((one) => one === localStorage.getItem(REMEMBERED)) ?? "auto";

export function apply(theme: Theme): void {
  const dark = theme === "dark" || (theme === "auto" && system.matches);
  document.documentElement.dataset.theme = dark ? "dark" : "light";
}

export function choose(theme: Theme): void {
  localStorage.setItem(REMEMBERED, theme);
  apply(theme);
}

system.addEventListener("change", () => apply(chosen()));

const isDark = () => document.documentElement.dataset.theme === "dark";

/** Whether the dark theme is on; draws again where it changes. */
export function useDark(): boolean {
  const [dark, setDark] = useState(isDark);
  useEffect(() => {
    const themed = new MutationObserver(() => setDark(isDark()));
    themed.observe(document.documentElement, { attributeFilter: ["data-theme"] });
    return () => themed.disconnect();
  }, []);
  return dark;
}
