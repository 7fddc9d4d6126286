// Plays the GLB named by ?file=..., or dropped on the page.
//   &time=0.4         stop at this moment [s] instead of playing
//   &view=filmed      look through the camera that the clip was filmed with
//   &scene=NAME       show this scene of the file instead of its default one
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { GLTFGaussianSplatLoaderExtension } from "three/addons/loaders/GLTFGaussianSplatLoaderExtension.js";

const query = new URLSearchParams(location.search);
const page = Object.fromEntries([...document.querySelectorAll("[id]")].map((e) => [e.id, e]));

// Draws splats too, which the older WebGLRenderer cannot; falls back to WebGL where there is no WebGPU.
const renderer = new THREE.WebGPURenderer({ antialias: true });
const world = new THREE.Scene();
world.background = new THREE.Color("#ffffff");
const eye = new THREE.PerspectiveCamera();
const orbit = new OrbitControls(eye, renderer.domElement);
const loader = new GLTFLoader();
loader.register((parser) => new GLTFGaussianSplatLoaderExtension(parser));

let asset = null; // the file shown: {scenes, filmed, mixer, length_s}
let isFilmedView = query.get("view") === "filmed";
let isPlaying = !query.has("time");

async function open(url, name) {
  say(`Reading ${name} …`);
  const gltf = await loader.loadAsync(url);
  if (asset) world.remove(...asset.scenes);
  world.add(...gltf.scenes);
  const mixer = new THREE.AnimationMixer(world);
  for (const animation of gltf.animations) mixer.clipAction(animation).play();
  const length_s = Math.max(0, ...gltf.animations.map((animation) => animation.duration));
  asset = { scenes: gltf.scenes, filmed: gltf.cameras[0], mixer, length_s };
  page.time.max = length_s;
  page.scene.replaceChildren(...gltf.scenes.map((scene) => new Option(scene.name)));
  page.scene.hidden = gltf.scenes.length < 2;
  page.filmed.hidden = !asset.filmed;
  show(gltf.scenes.find((scene) => scene.name === query.get("scene")) ?? gltf.scene);
  frame(gltf.scene);
  seek(Number(query.get("time") ?? 0));
  page.bar.hidden = false;
  say("");
  document.title = name;
}

function show(shown) {
  for (const scene of asset.scenes) scene.visible = scene === shown;
  // Splats are blended in sRGB, as they were trained: nothing may encode their colors again.
  let hasSplats = false;
  shown.traverse((object) => (hasSplats ||= Boolean(object.isGaussianSplat)));
  renderer.outputColorSpace = hasSplats ? THREE.LinearSRGBColorSpace : THREE.SRGBColorSpace;
  page.scene.value = shown.name;
}

// Stand where the whole object is in view, a little above it.
function frame(object) {
  const ball = new THREE.Box3().setFromObject(object).getBoundingSphere(new THREE.Sphere());
  const distance = (1.2 * ball.radius) / Math.sin(THREE.MathUtils.degToRad(35 / 2));
  orbit.target.copy(ball.center);
  eye.position.set(0.5, 0.35, 0.8).setLength(distance).add(ball.center);
  Object.assign(eye, { fov: 35, near: distance / 100, far: distance * 100 });
}

function seek(time_s) {
  // Just short of the end, where a repeating animation starts again.
  asset.mixer.setTime(Math.min(time_s, asset.length_s * (1 - 1e-6)));
  page.time.value = time_s;
  page.clock.textContent = `${time_s.toFixed(2)} s`;
}

// Look through the filming camera, with all of its picture inside the window.
function followFilmedCamera() {
  asset.filmed.updateWorldMatrix(true, false);
  asset.filmed.matrixWorld.decompose(eye.position, eye.quaternion, eye.scale);
  const { fov, near, far, aspect } = asset.filmed;
  const tangent = Math.tan(THREE.MathUtils.degToRad(fov / 2)) * Math.max(1, aspect / eye.aspect);
  Object.assign(eye, { fov: 2 * THREE.MathUtils.radToDeg(Math.atan(tangent)), near, far });
}

function say(text) {
  page.message.textContent = text;
  page.message.hidden = !text;
}

function fail(error) {
  document.documentElement.dataset.state = "failed";
  say(`${error.message ?? error}`);
}

function fillWindow() {
  eye.aspect = innerWidth / innerHeight;
  renderer.setPixelRatio(devicePixelRatio);
  renderer.setSize(innerWidth, innerHeight);
}

let last_ms = null;
function draw(now_ms) {
  if (asset) {
    const step_s = last_ms === null ? 0 : (now_ms - last_ms) / 1000;
    if (isPlaying && asset.length_s) seek((asset.mixer.time + step_s) % asset.length_s);
    if (isFilmedView && asset.filmed) followFilmedCamera();
    else orbit.update();
    eye.updateProjectionMatrix();
    renderer.render(world, eye);
    document.documentElement.dataset.state = "drawn";
  }
  last_ms = now_ms;
}

page.play.onclick = () => (isPlaying = !isPlaying);
page.time.oninput = () => ((isPlaying = false), seek(page.time.valueAsNumber));
page.scene.onchange = () => show(asset.scenes[page.scene.selectedIndex]);
page.filmed.onclick = () => ((isFilmedView = !isFilmedView), isFilmedView || frame(asset.scenes[0]));
addEventListener("resize", fillWindow);
addEventListener("keydown", (event) => event.key === " " && (event.preventDefault(), page.play.click()));
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", (event) => {
  event.preventDefault();
  const [file] = event.dataTransfer.files;
  if (file) open(URL.createObjectURL(file), file.name).catch(fail);
});

await renderer.init();
document.body.prepend(renderer.domElement);
fillWindow();
renderer.setAnimationLoop(draw);
const file = query.get("file");
if (file) await open(file, file.split("/").pop()).catch(fail);
