declare module "virtual:modules" {
  import type { Solid, Vector } from "./scene/modules";
  const modules: { name: string; kind: string; center?: Vector; body?: Solid[] }[];
  export default modules;
}
