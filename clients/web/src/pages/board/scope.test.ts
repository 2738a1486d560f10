import { expect, it } from "vitest";
import { scopeOf, scopesOf } from "./scope";

it("every category is a scope by its title, which an address names", () => {
  const scopes = scopesOf([
    { category: "support", category_title: "Bridges" },
    { category: "support", category_title: "Bridges" },
    { category: "my_own", category_title: "My own" },
  ]);
  expect(scopes.map(({ label }) => label)).toEqual(["All", "Bridges", "My own"]);
  expect(scopeOf({}, scopes)).toEqual({ key: "", label: "" });
  expect(scopeOf({ category: ["support"] }, scopes)).toEqual({ key: "support", label: "Bridges" });
  expect(scopeOf({ category: ["support", "gone_by"] }, scopes).label).toBe("Bridges, Gone by");
});
