/** Language and theme, remembered by this browser. */
import { createContext } from "preact";
import { useContext, useState } from "preact/hooks";
import { LANGUAGES, type Language, useWords } from "../i18n/index.ts";
import { choose, chosen, THEMES } from "../theme.ts";

export const LanguageContext = createContext<(language: Language) => void>(() => {});

export function Preferences() {
  const { t, language } = useWords();
  const setLanguage = useContext(LanguageContext);
  const [theme, setTheme] = useState(chosen);
  const next = () => {
    const following = THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length] ?? "auto";
    choose(following);
    setTheme(following);
  };
  return (
    <div class="prefs">
      <select
        aria-label={t("prefs.language")}
        value={language}
        onChange={(event) => setLanguage(event.currentTarget.value as Language)}
      >
        {Object.entries(LANGUAGES).map(([code, name]) => (
          <option key={code} value={code} lang={code}>
            {name}
          </option>
        ))}
      </select>
      <button
        type="button"
        aria-label={`${t("prefs.theme")}: ${t(`prefs.${theme}`)}`}
        title={t(`prefs.${theme}`)}
        onClick={next}
      >
        <svg viewBox="0 0 24 24" aria-hidden="true">
          {theme === "dark" && <path d="M19 14A8 8 0 0 1 10 5a8 8 0 1 0 9 9z" />}
          {theme !== "dark" && <circle cx="12" cy="12" r={theme === "auto" ? 8 : 4} />}
          {theme === "auto" && <path class="half" d="M12 4a8 8 0 0 1 0 16z" />}
          {theme === "light" && (
            <path d="M12 2v2M12 20v2M2 12h2M20 12h2M5 5l1.4 1.4M17.6 17.6 19 19M19 5l-1.4 1.4M6.4 17.6 5 19" />
          )}
        </svg>
      </button>
    </div>
  );
}
