/** Products with their densities, and the names of places; for the administrator. */
import { useState } from "preact/hooks";
import type { PageOf, Place, Product, UsualProduct } from "../data/answers.ts";
import { change } from "../data/client.ts";
import { changed, useResource } from "../data/resources.ts";
import { number } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";
import { Edit, etag, NumberEntry, numberIn, TextEntry, textIn } from "../parts/edit.tsx";

const again = (topic: string) => changed((topics) => topics.includes(topic));

const NEW: Product = { id: "", name: "", density_kg_m3: 700, density_std_kg_m3: 35, version: 0 };

/** An id that can stand in an address, of a name that need not. */
export const idOf = (name: string): string =>
  name
    .normalize("NFD")
    .toLowerCase()
    .replace(/[^a-z0-9]+/g, "-")
    .replace(/^-+|-+$/g, "")
    .slice(0, 80);

export function Products() {
  const { t, locale } = useWords();
  const products = useResource<PageOf<Product>>("products", "product");
  const all = products.data?.items ?? [];
  return (
    <section class="panel stack" aria-labelledby="products">
      <h2 id="products">{t("products.title")}</h2>
      <p class="quiet small">{t("products.about")}</p>
      <ul class="plain">
        {all.map((one) => (
          <li key={one.id} class="row apart">
            <div>
              <strong>{one.name}</strong>{" "}
              <span class="quiet">
                {number(locale, one.density_kg_m3, 0)} ± {number(locale, one.density_std_kg_m3, 0)} kg/m³
              </span>
            </div>
            <ProductForm product={one} known={all} />
          </li>
        ))}
      </ul>
      <Added known={all} />
    </section>
  );
}

/** Adding one, with the usual densities to begin from. */
function Added({ known }: { known: Product[] }) {
  const { t } = useWords();
  const usual = useResource<PageOf<UsualProduct>>("usual-products", "usual");
  const [from, setFrom] = useState("");
  const begun = usual.data?.items.find((one) => one.name === from);
  return (
    <div class="stack">
      <label class="field narrow">
        {t("products.usual")}
        <select value={from} onChange={(event) => setFrom(event.currentTarget.value)}>
          <option value="">–</option>
          {(usual.data?.items ?? []).map((one) => (
            <option key={one.name} value={one.name}>
              {one.name}
            </option>
          ))}
        </select>
      </label>
      <ProductForm key={from} product={{ ...NEW, ...begun }} known={known} title={t("products.add")} />
    </div>
  );
}

function ProductForm({ product, known, title }: { product: Product; known: Product[]; title?: string }) {
  const { t } = useWords();
  const send = async (entered: FormData) => {
    const name = textIn(entered, "name") ?? product.id;
    const body = {
      name,
      density_kg_m3: numberIn(entered, "density"),
      density_std_kg_m3: numberIn(entered, "deviation"),
    };
    const id = product.id || idOf(name) || `product-${known.length + 1}`;
    await change("PUT", `products/${encodeURIComponent(id)}`, body, product.id ? etag(product) : null);
    again("product");
  };
  return (
    <Edit name={product.id ? product.name : ""} title={title} version={product.version} send={send}>
      <TextEntry name="name" label={t("settings.name")} value={product.name} most={80} required />
      <NumberEntry
        name="density"
        label={t("products.density")}
        unit="kg/m³"
        value={product.density_kg_m3}
        min={10}
        max={10_000}
        required
      />
      <NumberEntry
        name="deviation"
        label={t("products.deviation")}
        unit="kg/m³"
        value={product.density_std_kg_m3}
        min={0}
        max={10_000}
        required
      />
    </Edit>
  );
}

export function PlaceNames() {
  const { t } = useWords();
  const places = useResource<PageOf<Place>>("places", "place");
  const all = places.data?.items ?? [];
  if (all.length === 0) return null;
  return (
    <section class="panel stack" aria-labelledby="places">
      <h2 id="places">{t("silos.places")}</h2>
      <ul class="plain">
        {all.map((place) => (
          <li key={place.id} class="row apart">
            <div>
              <strong>{place.name}</strong> <span class="quiet small">{place.zone}</span>
            </div>
            <Edit
              name={place.name}
              version={place.version}
              send={async (entered) => {
                const body = { name: textIn(entered, "name") ?? place.id, zone: textIn(entered, "zone") };
                await change("PUT", `places/${encodeURIComponent(place.id)}`, body, etag(place));
                changed((topics) => topics.includes("place") || topics.includes("silo"));
              }}
            >
              <TextEntry name="name" label={t("settings.name")} value={place.name} most={200} required />
              <TextEntry name="zone" label={t("settings.zone")} value={place.zone} most={64} />
            </Edit>
          </li>
        ))}
      </ul>
    </section>
  );
}
