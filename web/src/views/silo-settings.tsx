/** What an administrator sets of a silo: name, notice, product, lengths; and measuring all of it anew. */
import { useState } from "preact/hooks";
import type { PageOf, Product, Silo } from "../data/answers.ts";
import { change } from "../data/client.ts";
import { changed, useResource } from "../data/resources.ts";
import { number } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";
import { Action } from "../parts/action.tsx";
import { ChoiceEntry, Edit, etag, NumberEntry, numberIn, TextEntry, textIn } from "../parts/edit.tsx";
import { Facts } from "../parts/facts.tsx";

const again = () => changed((topics) => topics.includes("silo"));

export function SiloSettings({ silo }: { silo: Silo }) {
  const path = `silos/${encodeURIComponent(silo.id)}`;
  const set = async (values: object) => {
    await change("PUT", path, values, etag(silo));
    again();
  };
  return (
    <>
      <General silo={silo} set={set} />
      <Lengths silo={silo} set={set} />
      <Anew path={path} />
    </>
  );
}

interface Part {
  silo: Silo;
  set: (values: object) => Promise<void>;
}

function General({ silo, set }: Part) {
  const { t, locale } = useWords();
  const products = useResource<PageOf<Product>>("products", "product");
  const all = products.data?.items ?? [];
  const product = all.find((one) => one.id === silo.product);
  const send = (entered: FormData) =>
    set({
      name: textIn(entered, "name") ?? silo.id,
      banner: textIn(entered, "banner"),
      product: textIn(entered, "product"),
      stale_after_s: Math.max(1, Math.round((numberIn(entered, "stale") ?? 2) * 3600)),
    });
  const facts = [
    [t("settings.name"), silo.name],
    [t("settings.banner"), silo.banner ?? "–"],
    [t("settings.product"), product ? `${product.name}, ${number(locale, product.density_kg_m3, 0)} kg/m³` : "–"],
    [t("settings.stale"), `${number(locale, silo.stale_after_s / 3600, 1)} h`],
  ];
  return (
    <section class="stack" aria-labelledby="set-general">
      <h3 id="set-general">{t("settings.general")}</h3>
      <Facts rows={facts} />
      <Edit name={t("settings.general")} version={silo.version} send={send}>
        <TextEntry name="name" label={t("settings.name")} value={silo.name} most={200} required />
        <TextEntry name="banner" label={t("settings.banner")} value={silo.banner} most={500} />
        <ChoiceEntry
          name="product"
          label={t("settings.product")}
          value={silo.product ?? ""}
          of={[{ value: "", text: "–" }, ...all.map((one) => ({ value: one.id, text: one.name }))]}
        />
        <NumberEntry
          name="stale"
          label={t("settings.stale")}
          unit="h"
          value={silo.stale_after_s / 3600}
          min={0.01}
          max={8760}
          required
        />
      </Edit>
    </section>
  );
}

const LENGTHS = ["diameter", "cylinder", "cone", "top", "outlet_diameter", "outlet_length"] as const;
const BOTTOMS = ["", "cone", "flat", "unknown"] as const;

function Lengths({ silo, set }: Part) {
  const { t, named, locale } = useWords();
  const told = silo.vessel;
  const of = (name: string) => (typeof told[name] === "number" ? (told[name] as number) : null);
  const bottom = typeof told.bottom === "string" ? told.bottom : "";
  const send = (entered: FormData) => {
    const lengths = Object.fromEntries(LENGTHS.map((name) => [name, numberIn(entered, name)]));
    return set({ vessel: { ...lengths, bottom: textIn(entered, "bottom") } });
  };
  const facts = LENGTHS.filter((name) => of(name) !== null).map((name) => [
    named("length", name),
    `${number(locale, of(name) ?? 0, 3)} m`,
  ]);
  return (
    <section class="stack" aria-labelledby="set-lengths">
      <h3 id="set-lengths">{t("settings.lengths")}</h3>
      <p class="quiet small">{t("settings.lengthsAbout")}</p>
      <Facts rows={[...facts, [t("settings.bottom"), bottom ? named("bottom", bottom) : "–"]]} />
      <Edit name={t("settings.lengths")} version={silo.version} send={send}>
        {LENGTHS.map((name) => (
          <NumberEntry key={name} name={name} label={named("length", name)} unit="m" value={of(name)} max={200} />
        ))}
        <ChoiceEntry
          name="bottom"
          label={t("settings.bottom")}
          value={bottom}
          of={BOTTOMS.map((value) => ({ value, text: value ? named("bottom", value) : "–" }))}
        />
      </Edit>
    </section>
  );
}

/** Measures the kept frames again, with what is set now. */
function Anew({ path }: { path: string }) {
  const { t } = useWords();
  const [count, setCount] = useState<number | null>(null);
  return (
    <section class="stack" aria-labelledby="set-anew">
      <h3 id="set-anew">{t("settings.anew")}</h3>
      <p class="quiet small">{t("settings.anewAbout")}</p>
      <Action
        button={t("settings.anewDo")}
        send={async () => {
          const made = await change<{ frames: number }>("POST", `${path}/calibration:recompute`);
          setCount(made?.frames ?? 0);
        }}
      />
      <p role="status">{count !== null && t("settings.anewCount", { n: count })}</p>
    </section>
  );
}
