// Before the first paint, so that a dark page never flashes white; a file, as the policy allows no inline script.
(function () {
  var chosen = null;
  var known = "";
  try {
    chosen = localStorage.getItem("mantine-color-scheme-value");
    known = globalThis.sessionStorage.getItem("buildarena-key") ?? localStorage.getItem("buildarena-key");
  } catch {
    // Storage is closed to us: the system's scheme holds.
  }
  var dark = chosen === "dark" || (chosen !== "light" && matchMedia("(prefers-color-scheme: dark)").matches);
  document.documentElement.setAttribute("data-mantine-color-scheme", dark ? "dark" : "light");
  // The front page's figures are asked for before its scripts are there; a key is for these to send.
  var base = document.querySelector("meta[name=buildarena-base]")?.content ?? "";
  var path = document.location.pathname + document.location.search;
  if (known !== null || path !== base + "/" || document.querySelector("meta[name=buildarena-site]")) return;
  var figures = { rel: "preload", as: "fetch", crossOrigin: "", href: base + "/v1/leaderboard" };
  document.head.append(Object.assign(document.createElement("link"), figures));
})();
