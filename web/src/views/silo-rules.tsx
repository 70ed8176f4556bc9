/** The rules that hold for a silo, and changing one: for this silo alone, or where it holds now. */
import { useState } from "preact/hooks";
import { atLeast } from "../context.ts";
import type { PageOf, Place, Rule, Silo } from "../data/answers.ts";
import { change } from "../data/client.ts";
import { changed, useResource } from "../data/resources.ts";
import { duration } from "../format/dates.ts";
import { number, percent } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";
import { Action } from "../parts/action.tsx";
import { ChoiceEntry, Edit, etag, NumberEntry, numberIn } from "../parts/edit.tsx";
import { inForce } from "./places.ts";

const again = () => changed((topics) => topics.includes("rule") || topics.includes("alert"));

export function Rules({ silo }: { silo: Silo }) {
  const { t, named, locale } = useWords();
  const rules = useResource<PageOf<Rule>>("rules", "rule");
  const places = useResource<PageOf<Place>>("places", "place");
  const [chosen, setChosen] = useState<string | null>(null);
  const rows = inForce(rules.data?.items ?? [], silo, places.data?.items ?? []);
  const level = ({ unit }: Rule, told: number | null) => {
    const value = told ?? silo.stale_after_s;
    if (unit.startsWith("fraction")) return percent(locale, value);
    return unit === "seconds" ? duration(locale, value) : duration(locale, value * 3600);
  };
  if (rows.length === 0) return <p class="quiet">{t("rules.none")}</p>;
  const open = rows.find((rule) => rule.kind === chosen) ?? rows[0];
  return (
    <>
      <p class="quiet small">{t("rules.about")}</p>
      <div class="scroll">
        <table>
          <thead>
            <tr>
              <th scope="col">{t("rules.kind")}</th>
              <th scope="col" class="number">
                {t("rules.level")}
              </th>
              <th scope="col" class="number">
                {t("rules.clear")}
              </th>
              <th scope="col" class="number">
                {t("rules.delay")}
              </th>
            </tr>
          </thead>
          <tbody>
            {rows.map((rule) => (
              <tr key={rule.id}>
                <th scope="row">
                  {named("alert", rule.kind)} {!rule.enabled && <span class="badge">{t("rules.off")}</span>}{" "}
                  {rule.silo && <span class="badge">{t("rules.own")}</span>}
                </th>
                <td class="number">{level(rule, rule.level)}</td>
                <td class="number">{level(rule, rule.clear)}</td>
                <td class="number">{rule.delay_s ? duration(locale, rule.delay_s) : number(locale, 0, 0)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      {atLeast(silo.role, "admin") && open && (
        <>
          <label class="field narrow">
            {t("rules.choose")}
            <select value={open.kind} onChange={(event) => setChosen(event.currentTarget.value)}>
              {rows.map((rule) => (
                <option key={rule.kind} value={rule.kind}>
                  {named("alert", rule.kind)}
                </option>
              ))}
            </select>
          </label>
          <RuleForm key={open.kind} rule={open} silo={silo} places={places.data?.items ?? []} />
        </>
      )}
    </>
  );
}

const HERE = "silo";

function RuleForm({ rule, silo, places }: { rule: Rule; silo: Silo; places: Place[] }) {
  const { t, named } = useWords();
  const { factor, unit } = scaleOf(rule);
  const isOwn = rule.silo !== null;
  const wide = rule.place === null ? t("rules.everywhere") : (places.find((p) => p.id === rule.place)?.name ?? "");
  const send = async (entered: FormData) => {
    const values = {
      level: numberIn(entered, "level", factor),
      clear: numberIn(entered, "clear", factor),
      delay_s: Math.round((numberIn(entered, "delay") ?? 0) * 60),
      enabled: entered.get("enabled") === "on",
    };
    if (isOwn || entered.get("scope") !== HERE) {
      await change("PUT", `rules/${encodeURIComponent(rule.id)}`, values, etag(rule));
    } else {
      const own = { kind: rule.kind, silo: silo.id, channels: rule.channels, ...values };
      await change("PUT", `rules/${encodeURIComponent(`${silo.id}-${rule.kind}`.slice(0, 80))}`, own);
    }
    again();
  };
  const isLevel = rule.kind !== "no-data";
  return (
    <div class="stack">
      <Edit name={named("alert", rule.kind)} version={rule.version} send={send}>
        <NumberEntry
          name="level"
          label={t("rules.level")}
          unit={unit}
          value={times(rule.level, factor)}
          required={isLevel}
        />
        <NumberEntry
          name="clear"
          label={t("rules.clear")}
          unit={unit}
          value={times(rule.clear, factor)}
          required={isLevel}
        />
        <NumberEntry name="delay" label={t("rules.delay")} unit="min" value={rule.delay_s / 60} min={0} required />
        {!isOwn && (
          <ChoiceEntry
            name="scope"
            label={t("rules.scope")}
            value={HERE}
            of={[
              { value: HERE, text: t("rules.here") },
              { value: "wide", text: wide },
            ]}
          />
        )}
        <label class="row">
          <input type="checkbox" name="enabled" defaultChecked={rule.enabled} /> {t("rules.on")}
        </label>
      </Edit>
      {isOwn && (
        <Action
          button={t("rules.drop")}
          send={async () => {
            await change("DELETE", `rules/${encodeURIComponent(rule.id)}`, undefined, etag(rule));
            again();
          }}
        />
      )}
    </div>
  );
}

const times = (value: number | null, factor: number): number | null => (value === null ? null : value * factor);

/** How a rule's levels are entered: percent, or hours. */
function scaleOf({ unit }: Rule): { factor: number; unit: string } {
  if (unit.startsWith("fraction")) return { factor: 100, unit: "%" };
  return { factor: unit === "seconds" ? 1 / 3600 : 1, unit: "h" };
}
