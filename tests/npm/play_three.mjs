// Plays one .glb, .usda, .usdc or .usdz in three.js and writes where its vertices are.
//   node play_three.mjs FILE OUT_FOLDER TIMES_JSON
// OUT_FOLDER receives NAME.f32 of each skinned mesh and each set of points (splats, for a loader
// that does not know them): its rest pose, then one pose a time, in the world of three.js (Y-up,
// meters). Prints JSON: a list of {name, vertices, is_skinned, has_colors}.
import fs from "node:fs";
import path from "node:path";
import * as THREE from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { USDLoader } from "three/addons/loaders/USDLoader.js";

const [file, folder, times_json] = process.argv.slice(2);
const bytes = fs.readFileSync(file);
const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);

async function load() {
  if (/\.gl(b|tf)$/.test(file)) {
    return new GLTFLoader().parseAsync(buffer, "");
  }
  const scene = new USDLoader().parse(file.endsWith(".usda") ? bytes.toString() : buffer);
  return { scenes: [scene], animations: scene.animations };
}

const { scenes, animations } = await load();
const root = new THREE.Scene().add(...scenes);
const mixer = new THREE.AnimationMixer(root);
for (const animation of animations) mixer.clipAction(animation).play();
const meshes = [];
root.traverse((object) => (object.isSkinnedMesh || object.isPoints) && meshes.push(object));

const point = new THREE.Vector3();
function positions(mesh, place) {
  const { count } = mesh.geometry.attributes.position;
  const out = new Float32Array(3 * count);
  for (let i = 0; i < count; i++) place(mesh, i).applyMatrix4(mesh.matrixWorld).toArray(out, 3 * i);
  return out;
}
const at_rest = (mesh, i) => point.fromBufferAttribute(mesh.geometry.attributes.position, i);
const posed = (mesh, i) => (mesh.isSkinnedMesh ? mesh.getVertexPosition(i, point) : at_rest(mesh, i));

root.updateMatrixWorld(true);
const poses = new Map(meshes.map((mesh) => [mesh, [positions(mesh, at_rest)]]));
for (const time_s of JSON.parse(times_json)) {
  // Just below the end, since a looping action starts again there.
  mixer.setTime(Math.min(time_s, Math.max(...animations.map((a) => a.duration)) * (1 - 1e-9)));
  root.updateMatrixWorld(true);
  for (const mesh of meshes) poses.get(mesh).push(positions(mesh, posed));
}
for (const [mesh, arrays] of poses) {
  fs.writeFileSync(path.join(folder, `${mesh.name}.f32`), Buffer.concat(arrays.map((a) => new Uint8Array(a.buffer))));
}
const described = meshes.map((mesh) => ({
  name: mesh.name,
  vertices: mesh.geometry.attributes.position.count,
  is_skinned: Boolean(mesh.isSkinnedMesh),
  has_colors: Boolean(mesh.geometry.attributes.color && mesh.material.vertexColors),
}));
process.stdout.write(JSON.stringify(described));
