import js from "@eslint/js";
import hooks from "eslint-plugin-react-hooks";
import tseslint from "typescript-eslint";

export default tseslint.config(
  { ignores: ["src/api/contract.ts", "node_modules", "**/*.cjs"] },
  js.configs.recommended,
  {
    files: ["src/**/*.{ts,tsx}", "e2e/**/*.ts"],
    extends: [tseslint.configs.strictTypeChecked],
    plugins: { "react-hooks": hooks },
    languageOptions: { parserOptions: { projectService: true } },
    rules: {
      ...hooks.configs.recommended.rules,
      // The compiler is not used, and virtual lists are never memoised.
      "react-hooks/incompatible-library": "off",
      "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true }],
      "@typescript-eslint/no-confusing-void-expression": "off",
      "max-lines": ["error", 400],
      // What models and strangers wrote must never become markup.
      "no-restricted-syntax": ["error", { selector: "JSXAttribute[name.name='dangerouslySetInnerHTML']", message: "Text is text." }],
      // The router throws redirects and not-found answers.
      "@typescript-eslint/only-throw-error": "off",
    },
  },
  {
    files: ["public/*.js", "scripts/*.mjs"],
    languageOptions: { globals: { localStorage: "readonly", matchMedia: "readonly", document: "readonly", process: "readonly", console: "readonly", URL: "readonly", fetch: "readonly", scrollTo: "readonly", scrollY: "readonly", performance: "readonly", PerformanceObserver: "readonly", requestAnimationFrame: "readonly", setTimeout: "readonly" } },
  },
);
