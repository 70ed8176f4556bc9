import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";
import { ca } from "../src/i18n/ca.ts";
import { de } from "../src/i18n/de.ts";
import { en } from "../src/i18n/en.ts";
import { es } from "../src/i18n/es.ts";
import { fill } from "../src/i18n/fill.ts";

const OTHERS: Record<string, Record<string, string>> = { es, ca, de };
const named = (text: string) => [...text.matchAll(/\{(\w+)/g)].map((found) => found[1]).sort();

for (const [language, texts] of Object.entries(OTHERS)) {
  test(`${language} has every key, no other, and the same values in each text`, () => {
    assert.deepEqual(Object.keys(texts).sort(), Object.keys(en).sort());
    for (const [key, text] of Object.entries(en)) {
      assert.deepEqual(named(texts[key] ?? ""), named(text), key);
      assert.notEqual(texts[key]?.trim(), "", key);
    }
  });
}

test("every text that the page asks for is there, and every text is asked for", () => {
  const sources = new URL("../../../src/", import.meta.url);
  const files = readdirSync(sources, { recursive: true, encoding: "utf-8" }).filter(
    (name) => /\.tsx?$/.test(name) && !name.includes("i18n/"),
  );
  const source = files.map((name) => readFileSync(new URL(name, sources), "utf-8")).join("\n");
  const plain = [...source.matchAll(/"([a-z]+\.[a-zA-Z]+)"/g)].map((found) => found[1] ?? "");
  const families = [...source.matchAll(/(?:`([a-z]+)\.\$\{|(?:named|word)\("([a-z]+)")/g)].map(
    (found) => found[1] ?? found[2],
  );
  const isAsked = (key: string) => plain.includes(key) || families.includes(key.split(".")[0]);
  assert.deepEqual(
    Object.keys(en).filter((key) => !isAsked(key)),
    [],
  );
  const asked = [...source.matchAll(/\bt\(\s*"([a-z]+\.[a-zA-Z]+)"/g)].map((found) => found[1] ?? "");
  assert.ok(asked.length > 50);
  assert.deepEqual(
    asked.filter((key) => !(key in en)),
    [],
  );
});

test("values are filled in, forms chosen by the language's rule", () => {
  assert.equal(fill("en", "{n|# silo|# silos}", { n: 1 }), "1 silo");
  assert.equal(fill("de", "{n|# Silo|# Silos} in {place}", { n: 3, place: "Nord" }), "3 Silos in Nord");
  assert.equal(fill("en", "{unknown} stays", {}), "{unknown} stays");
});
