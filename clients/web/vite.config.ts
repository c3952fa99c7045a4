import { defineConfig, type Plugin } from "vite";

/** Have browsers fetch all scripts at once, which run one after the other. */
const fetchedAtOnce: Plugin = {
  name: "fetched-at-once",
  transformIndexHtml: {
    order: "post",
    handler: (_, { bundle }) =>
      Object.values(bundle ?? {}).flatMap((part) =>
        part.type === "chunk" && !part.isEntry
          ? [
              {
                tag: "link",
                attrs: { rel: "modulepreload", crossorigin: true, href: `./${part.fileName}` },
                injectTo: "head" as const,
              },
            ]
          : [],
      ),
  },
};

export default defineConfig({
  base: "./",
  plugins: [fetchedAtOnce],
  build: {
    outDir: "../../engine/sketchmatch/server/pad",
    emptyOutDir: true,
    target: "es2022",
    // A page that may load nothing inline has its pictures as files.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
  },
  server: { proxy: { "/sketchmatch.": process.env.SKETCHMATCH_WEB ?? "http://127.0.0.1:8080" } },
});
