// Opens a page in headless Chromium and saves what it shows, from a JSON job on stdin:
//   {url, folders: {URL_PREFIX: FOLDER}, width_px, height_px, out, hide}
// Whatever lies below a prefix comes from its folder, the pinned three.js in place of its CDN
// included (the page's integrity hashes still count); nothing else is reachable. Chromium is that
// of $CHROMIUM or the PATH, else the one that `npx playwright-core install` brings.
import fs from "node:fs";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const here = path.dirname(fileURLToPath(import.meta.url));
const three = `https://cdn.jsdelivr.net/npm/three@${JSON.parse(fs.readFileSync(path.join(here, "package.json"))).dependencies.three}/`;
const job = JSON.parse(fs.readFileSync(0, "utf8"));
const folders = { ...job.folders, [three]: path.join(here, "node_modules", "three") };

function findChromium() {
  const names = ["chromium", "chromium-browser", "google-chrome"];
  const places = process.env.PATH.split(path.delimiter);
  const found = [process.env.CHROMIUM, ...places.flatMap((place) => names.map((n) => path.join(place, n))), chromium.executablePath()];
  const first = found.find((file) => file && fs.existsSync(file));
  if (first) return first;
  console.error(
    "Chromium is missing: install it (apt-get install chromium), name one in $CHROMIUM, or run " +
      `\`npx playwright-core install --with-deps chromium\` in ${here}`,
  );
  process.exit(1);
}

async function serve(route) {
  const url = route.request().url().split("?")[0];
  const prefix = Object.keys(folders).find((start) => url.startsWith(start));
  const rest = prefix && decodeURIComponent(url.slice(prefix.length));
  const file = prefix && path.join(folders[prefix], rest || "index.html");
  if (!file || !fs.existsSync(file)) {
    if (!url.endsWith("favicon.ico")) complaints.push(`not served: ${url}`);
    return route.fulfill({ status: 404 });
  }
  return route.fulfill({ path: file, headers: { "access-control-allow-origin": "*" } });
}

const complaints = [];
const browser = await chromium.launch({
  executablePath: findChromium(),
  args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
try {
  const viewport = { width: job.width_px, height: job.height_px };
  const page = await browser.newPage({ viewport });
  page.on("pageerror", (error) => complaints.push(error.message));
  page.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
  await page.route(/^http/, serve);
  await page.goto(job.url, { waitUntil: "commit", timeout: 300_000 });
  const deadline_ms = Date.now() + 300_000;
  while (!complaints.length && !(await page.evaluate(() => document.documentElement.dataset.state))) {
    if (Date.now() > deadline_ms) complaints.push("nothing was drawn for five minutes");
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
  if (job.hide) await page.addStyleTag({ content: `${job.hide} { display: none !important }` });
  await page.screenshot({ path: job.out, timeout: 300_000 });
} finally {
  await browser.close();
}
if (complaints.length) {
  console.error(complaints.join("\n"));
  process.exit(1);
}
