/** The page as a whole: language, session, live connection, and the view that the address names. */
import { useCallback, useEffect, useMemo, useRef, useState } from "preact/hooks";
import { atLeast, SurroundingsContext, useFiring } from "./context.ts";
import type { Change, Site } from "./data/answers.ts";
import { change } from "./data/client.ts";
import { follow, type Link } from "./data/live.ts";
import { changed, refreshAll, useResource } from "./data/resources.ts";
import { type Language, load, remember, type Texts, WordsContext, words } from "./i18n/index.ts";
import { Lost, Short } from "./parts/lost.tsx";
import { LanguageContext } from "./parts/preferences.tsx";
import { Top } from "./parts/top.tsx";
import { Waiting } from "./parts/waiting.tsx";
import { type Route, useRoute } from "./router.ts";
import { Alerts } from "./views/alerts.tsx";
import { Cameras } from "./views/cameras.tsx";
import { Install } from "./views/install.tsx";
import { Login, Welcome } from "./views/login.tsx";
import { Settings } from "./views/settings.tsx";
import { SiloView } from "./views/silo.tsx";
import { Silos } from "./views/silos.tsx";

interface Spoken {
  language: Language;
  texts: Texts;
}

export function App({ start }: { start: Spoken }) {
  const [spoken, setSpoken] = useState(start);
  const value = useMemo(() => words(spoken.language, spoken.texts), [spoken]);
  useEffect(() => {
    document.documentElement.lang = value.locale;
  }, [value]);
  const choose = useCallback((language: Language) => {
    remember(language);
    void load(language).then((texts) => setSpoken({ language, texts }));
  }, []);
  return (
    <LanguageContext.Provider value={choose}>
      <WordsContext.Provider value={value}>
        <Entrance />
      </WordsContext.Provider>
    </LanguageContext.Provider>
  );
}

/** Asks who looks, and shows the login where the server wants one. */
function Entrance() {
  const route = useRoute();
  const site = useResource<Site>("site", "session", "site");
  const again = useCallback(() => changed(() => true), []);
  if (route.view === "welcome") return <Welcome secret={route.secret} />;
  if (site.problem?.status === 401) return <Login entered={again} />;
  if (!site.data) return <Waiting resource={site} />;
  return <Inside route={route} site={site.data} />;
}

function Inside({ route, site }: { route: Route; site: Site }) {
  const link = useLive(site.last_change);
  const leave = useCallback(() => void change("DELETE", "session").finally(refreshAll), []);
  const around = useMemo(() => ({ site, link, leave }), [site, link, leave]);
  const firing = useFiring().filter((alert) => !alert.acknowledged).length;
  const key = route.view === "silo" ? route.silo : route.view;
  useEffect(() => {
    window.scrollTo(0, 0);
    void key;
  }, [key]);
  return (
    <SurroundingsContext.Provider value={around}>
      {route.view !== "install" && <Top route={route} firing={firing} />}
      {link === "lost" && <Lost />}
      {site.disk_short && <Short site={site} />}
      <View route={route} role={site.role} />
    </SurroundingsContext.Provider>
  );
}

function View({ route, role }: { route: Route; role: string | null }) {
  if (route.view === "silo") return <SiloView key={route.silo} id={route.silo} tab={route.tab} />;
  if (route.view === "alerts") return <Alerts />;
  if (route.view === "install") return <Install key={route.camera} camera={route.camera} />;
  if (route.view === "cameras" && atLeast(role, "viewer")) return <Cameras />;
  if (route.view === "settings" && atLeast(role, "admin")) return <Settings />;
  return <Silos place={route.view === "silos" ? route.place : null} />;
}

/** Follows the server's changes; after a lost link everything that is shown is fetched anew. */
function useLive(newest: number): Link {
  const [link, setLink] = useState<Link>("open");
  const begin = useRef(newest);
  useEffect(() => {
    let before: Link = "open";
    return follow(begin.current, {
      event: ({ type, data }) => (type === "reset" ? refreshAll() : told(data)),
      link: (now) => {
        if (now === "open" && before === "lost") refreshAll();
        before = now;
        setLink(now);
      },
      denied: () => changed((topics) => topics.includes("session")),
    });
  }, []);
  return link;
}

/** Refreshes what a change concerns: resources of its kind, of its silo or of all silos. */
function told(data: string): void {
  const { kind, silo } = JSON.parse(data) as Change;
  const isOther = (topic: string) => silo !== null && topic.startsWith("of:") && topic !== `of:${silo}`;
  changed((topics) => topics.includes(kind) && !topics.some(isOther));
}
