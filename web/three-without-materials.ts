import { fileURLToPath } from "node:url";
import type { Plugin } from "vite";

/**
 * three.js without the GLSL of its own materials.
 *
 * The page draws with shaders of its own (`src/three/shaders.ts`), so the sources of the standard materials would be
 * 32 kB (gzip) that nothing runs. `ShaderChunk` is the one module that holds them; the renderer itself reads only the
 * two entries that stay, and only for tone mapping, which the page does not use.
 */
export function threeWithoutMaterials(): Plugin {
  const entry = fileURLToPath(new URL("node_modules/three/src/Three.js", import.meta.url));
  return {
    name: "three-without-materials",
    enforce: "pre",
    resolveId: (id) => (id === "three" ? entry : null),
    load: (id) =>
      id.endsWith("/renderers/shaders/ShaderChunk.js")
        ? 'export const ShaderChunk = { tonemapping_pars_fragment: "", colorspace_pars_fragment: "" };'
        : null,
  };
}
