/** The cut-open vessel with its content, drawn by three.js. This module alone imports it, and is loaded on demand. */
import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  GLSL3,
  LineSegments,
  Mesh,
  PerspectiveCamera,
  RawShaderMaterial,
  Scene,
  Vector3,
  WebGLRenderer,
} from "three";
import type { SurfaceGrid } from "./grid.ts";
import { bodyMesh, outline, type Shape, surfaceMesh, type Triangles, vesselMesh } from "./meshes.ts";
import type { Colouring, Rgb } from "./palette.ts";
import { FRAGMENT, LINE_FRAGMENT, LINE_VERTEX, VERTEX } from "./shaders.ts";

export interface View {
  show(grid: SurfaceGrid, shape: Shape, by: Colouring, tints: Tints): void;
  /** Turns by radians about the axis, and up. */
  turn(about: number, up: number): void;
  zoom(factor: number): void;
  dispose(): void;
}

export interface Tints {
  wall: Rgb;
  line: Rgb;
  body: Rgb;
}

const START = { about: 0, up: 0.5, distance: 1 };

/** Throws where the browser gives no WebGL 2 context. */
export function createView(canvas: HTMLCanvasElement): View {
  const renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
  renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
  const scene = new Scene();
  const camera = new PerspectiveCamera(28, 1, 0.05, 500);
  const look = { ...START };
  let shape: Shape = { radius: 1, cone: 1, cylinder: 2 };
  let waiting = 0;

  const draw = () => {
    waiting = 0;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (width === 0 || height === 0) return;
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    aim(camera, shape, look);
    renderer.render(scene, camera);
    canvas.dataset.drawn = String(Number(canvas.dataset.drawn ?? 0) + 1);
  };
  const soon = () => {
    waiting ||= requestAnimationFrame(draw);
  };
  const resized = new ResizeObserver(soon);
  resized.observe(canvas);

  return {
    show(grid, next, by, tints) {
      clear(scene);
      shape = next;
      build(scene, grid, next, by, tints);
      soon();
    },
    turn(about, up) {
      look.about += about;
      look.up = Math.min(1.45, Math.max(-0.1, look.up + up));
      soon();
    },
    zoom(factor) {
      look.distance = Math.min(2, Math.max(0.35, look.distance * factor));
      soon();
    },
    dispose() {
      cancelAnimationFrame(waiting);
      resized.disconnect();
      clear(scene);
      renderer.dispose();
    },
  };
}

function aim(camera: PerspectiveCamera, shape: Shape, look: typeof START): void {
  const height = shape.cone + shape.cylinder;
  const half = (camera.fov * Math.PI) / 360;
  const tall = (height / 2) * Math.cos(look.up) + shape.radius * Math.sin(Math.max(0, look.up));
  const wide = shape.radius / Math.min(1, camera.aspect);
  const away = (look.distance * 1.04 * Math.hypot(Math.max(tall, wide), shape.radius * 0.3)) / Math.tan(half);
  const target = new Vector3(0, 0, height / 2);
  const flat = away * Math.cos(look.up);
  camera.position.set(flat * Math.sin(look.about), -flat * Math.cos(look.about), target.z + away * Math.sin(look.up));
  camera.up.set(0, 0, 1);
  camera.near = away / 50;
  camera.far = away * 4;
  camera.lookAt(target);
  camera.updateProjectionMatrix();
}

// The half of the wall that is farther away at the start stays; the viewer looks along +y.
const CUT: [number, number] = [0, Math.PI];

function build(scene: Scene, grid: SurfaceGrid, shape: Shape, by: Colouring, tints: Tints): void {
  scene.add(solid(vesselMesh(shape, ...CUT, tints.wall), 0.55, 1));
  scene.add(solid(bodyMesh(grid, shape, tints.body), 1, 0));
  scene.add(solid(surfaceMesh(grid, shape, by), 1, 0, by === "height" ? 1 : 0.55));
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(outline(shape, ...CUT)), 3));
  const material = new RawShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: LINE_VERTEX,
    fragmentShader: LINE_FRAGMENT,
    uniforms: { tint: { value: new Vector3(...tints.line) } },
  });
  scene.add(new LineSegments(geometry, material));
}

function solid(triangles: Triangles, opacity: number, order: number, shading = 1): Mesh {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(triangles.positions), 3));
  geometry.setAttribute("normal", new BufferAttribute(new Float32Array(triangles.normals), 3));
  geometry.setAttribute("color", new BufferAttribute(new Float32Array(triangles.colours), 3));
  geometry.setIndex(triangles.indices);
  const material = new RawShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: { opacity: { value: opacity }, shading: { value: shading } },
    transparent: opacity < 1,
    depthWrite: opacity === 1,
    side: DoubleSide,
  });
  const mesh = new Mesh(geometry, material);
  mesh.renderOrder = order;
  return mesh;
}

function clear(scene: Scene): void {
  for (const child of [...scene.children]) {
    scene.remove(child);
    if (child instanceof Mesh || child instanceof LineSegments) {
      child.geometry.dispose();
      child.material.dispose();
    }
  }
}
