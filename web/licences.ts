import { readFileSync } from "node:fs";
import type { Plugin } from "vite";

const PACKAGES = ["preact", "uplot", "three"];

/** Puts the licence texts of what is built in beside the built page. */
export function licences(): Plugin {
  const read = (name: string, file: string) =>
    readFileSync(new URL(`node_modules/${name}/${file}`, import.meta.url), "utf-8");
  const text = (name: string) => {
    const { version } = JSON.parse(read(name, "package.json")) as { version: string };
    return `${name} ${version}\n\n${read(name, "LICENSE")}`;
  };
  return {
    name: "licences",
    generateBundle() {
      this.emitFile({
        type: "asset",
        fileName: "LICENSES.txt",
        source: PACKAGES.map(text).join(`\n${"-".repeat(80)}\n\n`),
      });
    },
  };
}
