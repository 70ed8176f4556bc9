import { defineConfig } from "vite";
import { licences } from "./licences.ts";
import { threeWithoutMaterials } from "./three-without-materials.ts";

// Assets are named relative to the document, so the page works below any path; nothing is put inline, so it works under
// `script-src 'self'; style-src 'self'`.
export default defineConfig({
  base: "./",
  plugins: [threeWithoutMaterials(), licences()],
  oxc: { jsx: { runtime: "automatic", importSource: "preact" } },
  build: {
    outDir: "../python/siloscope/monitor/page",
    emptyOutDir: true,
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    cssCodeSplit: false,
    chunkSizeWarningLimit: 600,
  },
});
