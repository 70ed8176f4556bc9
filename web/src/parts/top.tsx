/** Name, ways, preferences; on a phone the ways are at the bottom, under the thumb. */
import { atLeast, useSurroundings } from "../context.ts";
import { useWords } from "../i18n/index.ts";
import { link, type Route } from "../router.ts";
import { Preferences } from "./preferences.tsx";

const ICONS = {
  silos: "M6 10 12 5l6 5v8l-4 3h-4l-4-3zM6 14h12",
  alerts: "M12 4a6 6 0 0 1 6 6v4l2 3H4l2-3v-4a6 6 0 0 1 6-6zM10 20h4",
  cameras: "M4 8h4l2-3h4l2 3h4v11H4zM12 17a4 4 0 1 0 0-8 4 4 0 0 0 0 8",
  settings: "M4 7h10M18 7h2M4 12h3M11 12h9M4 17h8M16 17h4M16 5v4M9 10v4M14 15v4",
} as const;

export function Top({ route, firing }: { route: Route; firing: number }) {
  const { t } = useWords();
  const { site, leave } = useSurroundings();
  const here = route.view === "silo" ? "silos" : route.view;
  const ways = (["silos", "alerts", "cameras", "settings"] as const).filter(
    (way) => way === "silos" || way === "alerts" || atLeast(site.role, way === "cameras" ? "viewer" : "admin"),
  );
  const skip = () => document.getElementById("main")?.focus();
  return (
    <header class="top">
      <button type="button" class="skip" onClick={skip}>
        {t("nav.skip")}
      </button>
      <a class="brand" href={link.silos()}>
        <img src="./icon.svg" alt="" />
        <span>siloscope</span>
      </a>
      <nav aria-label={t("nav.label")}>
        {ways.map((way) => (
          <a
            key={way}
            href={way === "silos" ? link.silos() : link[way]}
            aria-current={here === way ? "page" : undefined}
          >
            <svg viewBox="0 0 24 24" aria-hidden="true">
              <path d={ICONS[way]} />
            </svg>
            {t(`nav.${way}`)}
            {way === "alerts" && firing > 0 && (
              <span class="count">
                {firing}
                <span class="unseen"> {t("alerts.unseen")}</span>
              </span>
            )}
          </a>
        ))}
      </nav>
      <Preferences />
      {site.kind === "user" && (
        <button type="button" class="wide" onClick={leave}>
          {t("nav.leave", { name: site.person })}
        </button>
      )}
    </header>
  );
}
