declare module "virtual:modules" {
  type Vector = readonly [number, number, number];
  type Solid =
    | { shape: "box"; from: Vector; to: Vector }
    | { shape: "cylinder"; radius: number; from: Vector; to: Vector }
    | { shape: "sphere"; radius: number; center: Vector };
  const modules: { name: string; kind: string; center?: Vector; body?: Solid[] }[];
  export default modules;
}

declare module "*.md?raw" {
  const text: string;
  export default text;
}
