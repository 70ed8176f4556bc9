/** The site: its tree of places, and a card for every silo in the chosen one. */
import { useMemo } from "preact/hooks";
import { useFiring } from "../context.ts";
import type { PageOf, Place, Product, Silo } from "../data/answers.ts";
import { useResource } from "../data/resources.ts";
import { useWords } from "../i18n/index.ts";
import { Card } from "../parts/card.tsx";
import { Waiting } from "../parts/waiting.tsx";
import { link } from "../router.ts";
import { type Branch, branches, within } from "./places.ts";

export function Silos({ place }: { place: string | null }) {
  const { t } = useWords();
  const silos = useResource<PageOf<Silo>>("silos", "silo", "reading", "alert", "forecast", "frame");
  const places = useResource<PageOf<Place>>("places", "place");
  const products = useResource<PageOf<Product>>("products", "product");
  const firing = useFiring();
  const tree = useMemo(() => branches(places.data?.items ?? [], silos.data?.items ?? []), [places.data, silos.data]);
  if (!silos.data) return <Waiting resource={silos} />;
  const all = silos.data.items;
  const shown = place === null ? all : all.filter((silo) => within(places.data?.items ?? [], silo.place, place));
  const alertsOf = (silo: Silo) => firing.filter((alert) => alert.silo === silo.id);
  const alerts = shown.reduce((sum, silo) => sum + alertsOf(silo).length, 0);
  const productOf = (silo: Silo) =>
    products.data?.items.find((product) => product.id === silo.product)?.name ?? silo.product;
  const title = places.data?.items.find((one) => one.id === place)?.name ?? t("silos.all");
  return (
    <div class={`whole${tree.length ? "" : " single"}`}>
      {tree.length > 0 && (
        <nav class="tree" aria-label={t("silos.places")}>
          <ul>
            <li>
              <PlaceLink id={null} name={t("silos.all")} count={all.length} chosen={place} />
            </li>
            <Branches of={tree} chosen={place} />
          </ul>
        </nav>
      )}
      <main id="main" class="stack" tabIndex={-1}>
        <div class="row apart">
          <div>
            <h1>{title}</h1>
            <p class="quiet">
              {t("silos.count", { n: shown.length })}
              {alerts > 0 && ` · ${t("alerts.count", { n: alerts })}`}
            </p>
          </div>
          {tree.length > 0 && <PlaceChoice tree={tree} chosen={place} />}
        </div>
        {shown.length === 0 && <p class="panel">{t("silos.none")}</p>}
        <ul class="cards">
          {shown.map((silo) => (
            <Card key={silo.id} silo={silo} product={productOf(silo)} alerts={alertsOf(silo)} />
          ))}
        </ul>
      </main>
    </div>
  );
}

function Branches({ of, chosen }: { of: Branch[]; chosen: string | null }) {
  return (
    <>
      {of.map(({ place, count, below }) => (
        <li key={place.id}>
          <PlaceLink id={place.id} name={place.name} count={count} chosen={chosen} />
          {below.length > 0 && (
            <ul>
              <Branches of={below} chosen={chosen} />
            </ul>
          )}
        </li>
      ))}
    </>
  );
}

interface LinkProps {
  id: string | null;
  name: string;
  count: number;
  chosen: string | null;
}

const PlaceLink = ({ id, name, count, chosen }: LinkProps) => (
  <a href={link.silos(id)} aria-current={id === chosen ? "true" : undefined}>
    {name} <span class="quiet">{count}</span>
  </a>
);

/** The tree as a list to choose from, where the screen is narrow. */
function PlaceChoice({ tree, chosen }: { tree: Branch[]; chosen: string | null }) {
  const { t } = useWords();
  const flat = (of: Branch[], depth: number): { id: string; text: string }[] =>
    of.flatMap(({ place, below }) => [
      { id: place.id, text: `${"\u2003".repeat(depth)}${place.name}` },
      ...flat(below, depth + 1),
    ]);
  return (
    <select
      class="places"
      aria-label={t("silos.places")}
      value={chosen ?? ""}
      onChange={(event) => {
        window.location.hash = link.silos(event.currentTarget.value || null);
      }}
    >
      <option value="">{t("silos.all")}</option>
      {flat(tree, 0).map(({ id, text }) => (
        <option key={id} value={id}>
          {text}
        </option>
      ))}
    </select>
  );
}
