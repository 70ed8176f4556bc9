import assert from "node:assert/strict";
import { test } from "node:test";
import { age, days, duration, midnights } from "../src/format/dates.ts";
import { decimalsOf, degrees, mass, percent, withDeviation } from "../src/format/numbers.ts";

test("a deviation is written with one significant digit, two where the first is a 1", () => {
  assert.deepEqual([0.3, 0.14, 0.026, 3, 40, 1.2].map(decimalsOf), [1, 2, 2, 0, 0, 1]);
  assert.deepEqual(withDeviation("en-GB", 15.0432, 0.46), { value: "15.0", deviation: "0.5" });
  assert.deepEqual(withDeviation("de", 1234.5678, 0.142), { value: "1.234,57", deviation: "0,14" });
});

test("without a deviation none is made up", () => {
  assert.equal(withDeviation("en-GB", 2.25, null).deviation, null);
  assert.equal(withDeviation("en-GB", 2.25, 0).deviation, null);
});

test("mass is in tonnes from one tonne on, deviation in the same unit", () => {
  assert.deepEqual(mass("en-GB", 15_040, 460), { value: "15.0", deviation: "0.5", unit: "t" });
  assert.deepEqual(mass("en-GB", 640, 30), { value: "640", deviation: "30", unit: "kg" });
});

test("percent and degrees follow the language", () => {
  assert.equal(percent("en-GB", 0.823), "82%");
  assert.equal(percent("de", 0.823).replace(/\s/g, " "), "82 %");
  assert.equal(degrees("es", Math.PI / 60), "3,0°");
});

test("an age is told in the largest unit that fits", () => {
  assert.equal(age("en-GB", 600), "10 minutes ago");
  assert.equal(age("en-GB", 5 * 3600), "5 hours ago");
  assert.equal(age("en-GB", 3 * 86_400), "3 days ago");
  assert.equal(age("de", 600), "vor 10 Minuten");
  assert.equal(age("en-GB", 10), "now");
});

test("durations have their unit", () => {
  assert.equal(duration("en-GB", 7200), "2 hours");
  assert.equal(duration("ca", 600), "10 minuts");
});

test("a span of days is in the place's zone", () => {
  const from = Date.parse("2026-12-01T23:30:00Z");
  const to = Date.parse("2026-12-06T12:00:00Z");
  assert.match(days("en-GB", from, to, "Europe/Madrid"), /^2\s?–\s?6 Dec$/u);
  assert.match(days("en-GB", from, to, "UTC"), /^1\s?–\s?6 Dec$/u);
});

const seconds = (text: string) => Date.parse(text) / 1000;
const hoursOf = (from: string, to: string, zone: string, every = 1) => {
  const found = midnights(seconds(from), seconds(to), zone, every);
  return {
    first: new Date((found[0] ?? 0) * 1000).toISOString(),
    hours: found.slice(1).map((at, i) => (at - (found[i] ?? 0)) / 3600),
  };
};

test("days begin at the place's midnight, also where clocks change", () => {
  const spring = hoursOf("2026-03-28T12:00:00Z", "2026-03-30T12:00:00Z", "Europe/Madrid");
  assert.deepEqual(spring, { first: "2026-03-27T23:00:00.000Z", hours: [24, 23, 24] });
  const autumn = hoursOf("2026-10-24T12:00:00Z", "2026-10-26T12:00:00Z", "Europe/Madrid");
  assert.deepEqual(autumn, { first: "2026-10-23T22:00:00.000Z", hours: [24, 25, 24] });
});

test("zones of half hours, half-hour changes and changes at midnight have their days", () => {
  const delhi = hoursOf("2026-03-28T12:00:00Z", "2026-03-29T12:00:00Z", "Asia/Kolkata");
  assert.deepEqual(delhi, { first: "2026-03-27T18:30:00.000Z", hours: [24, 24] });
  const island = hoursOf("2026-04-04T00:00:00Z", "2026-04-05T18:00:00Z", "Australia/Lord_Howe");
  assert.deepEqual(island, { first: "2026-04-03T13:00:00.000Z", hours: [24, 24.5, 24] });
  const havana = hoursOf("2026-03-07T12:00:00Z", "2026-03-09T12:00:00Z", "America/Havana");
  assert.deepEqual(havana, { first: "2026-03-07T05:00:00.000Z", hours: [24, 23, 24] });
  const twice = hoursOf("2026-10-31T12:00:00Z", "2026-11-02T12:00:00Z", "America/Havana");
  assert.deepEqual(twice, { first: "2026-10-31T04:00:00.000Z", hours: [24, 25, 24] });
});

test("stretches of several days have whole days", () => {
  const week = hoursOf("2026-03-24T12:00:00Z", "2026-03-30T12:00:00Z", "Europe/Madrid", 7);
  assert.deepEqual(week, { first: "2026-03-23T23:00:00.000Z", hours: [167] });
});
