import react from "@vitejs/plugin-react";
import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import type { Plugin } from "vite";
import { defineConfig } from "vitest/config";

export const here = (path: string): string => fileURLToPath(new URL(path, import.meta.url));

const MODULES = ["modules.yaml", "extended.yaml"].map((file) =>
  here(`../../libs/geometry/src/buildarena_geometry/modules/${file}`),
);

interface ModulesFile {
  modules: { name: string; kind: string; center?: number[]; body?: unknown[] }[];
}

/** What of the geometry library's modules a page draws; the files are JSON, whatever their endings say. */
export const moduleShapes: Plugin = {
  name: "module-shapes",
  resolveId: (id) => (id === "virtual:modules" ? "\0modules" : null),
  load(id) {
    if (id !== "\0modules") return null;
    const modules = MODULES.flatMap((file) => (JSON.parse(readFileSync(file, "utf8")) as ModulesFile).modules);
    const shapes = modules.map(({ name, kind, center, body }) => ({ name, kind, center, body }));
    return `export default ${JSON.stringify(shapes)};`;
  },
};

export default defineConfig({
  plugins: [react(), moduleShapes],
  // Scripts find each other wherever the pages lie: `buildarena site` publishes them under any path.
  experimental: { renderBuiltUrl: (file, { hostType }) => (hostType === "html" ? `/${file}` : { relative: true }) },
  build: {
    outDir: here("../../services/api/src/buildarena_api/pages"),
    emptyOutDir: true,
    target: "es2022",
    // The policy has no data: for scripts, and small files compress well.
    assetsInlineLimit: 0,
    chunkSizeWarningLimit: 1200,
    // Libraries that every page needs are read one after the other, so that none holds a page up for long.
    rolldownOptions: {
      output: {
        // What every page runs at once is compiled beside its main thread.
        postBanner: ({ name }) => (/^(index|react|tanstack|shared)$/.test(name) ? "//# allFunctionsCalledOnLoad" : ""),
        codeSplitting: {
          groups: [
            { name: "react", test: /node_modules[\\/](react|react-dom|scheduler)[\\/]/ },
            { name: "tanstack", test: /node_modules[\\/]@tanstack[\\/](react-)?(router|query|history)/ },
            // What several pages share is one file: two dozen small ones take longer than it does.
            { name: "shared", minShareCount: 4, test: /node_modules[\\/]@mantine|src[\\/](parts|api|format)/ },
          ],
        },
      },
    },
  },
  server: {
    fs: { allow: [here("../..")] },
    proxy: { "/v1": process.env.BUILDARENA_URL ?? "http://127.0.0.1:8000" },
  },
  test: { include: ["src/**/*.test.ts"] },
});
