// What the viewer draws with: bundled into server/page/vendor/splats.js.
export { Box3, Color, Group, Matrix4, PerspectiveCamera, Quaternion, Scene, Vector3, WebGLRenderer } from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
export { SparkRenderer, SplatMesh } from "@sparkjsdev/spark";
export { ZSTDDecoder } from "zstddec";
