// Compresses the built pages once, so that the service never does while it answers.
import { readdirSync, readFileSync, statSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { brotliCompressSync, constants, gzipSync } from "node:zlib";

const out = fileURLToPath(new URL("../../../services/api/src/buildarena_api/pages", import.meta.url));
const WORTH_IT = /\.(js|css|html|svg|json|map)$/;

for (const name of readdirSync(out, { recursive: true })) {
  const file = join(out, String(name));
  if (!statSync(file).isFile() || !WORTH_IT.test(file)) continue;
  const data = readFileSync(file);
  if (data.length < 512) continue;
  writeFileSync(`${file}.gz`, gzipSync(data, { level: 9 }));
  writeFileSync(`${file}.br`, brotliCompressSync(data, { params: { [constants.BROTLI_PARAM_QUALITY]: 9 } }));
}
