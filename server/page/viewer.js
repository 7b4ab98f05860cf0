// Turns a scene: three.js and Spark draw it, the mouse, a finger, keys or buttons turn it, and pictures can be taken of it.
import { announce, element } from "./elements.js";
import { Mistake } from "./errors.js";
import { parts } from "./formats.js";

/** It is drawn for so long after something changed: sorting takes a while. */
const AWAKE = 1500;
const STEP = Math.PI / 18;
const FIELD_OF_VIEW = 45;

/** Shows a scene file in `box`. `taken` gets each picture that is taken, as a PNG file. */
export async function show(box, file, taken) {
    const { Box3, Color, Group, OrbitControls, PerspectiveCamera, Scene, SparkRenderer, SplatMesh, Vector3, WebGLRenderer } =
        await import("./vendor/splats.js");
    const canvas = element("canvas", {
        tabIndex: 0,
        role: "application",
        "aria-label": "The scene. Arrow keys turn it, plus and minus come nearer and go away.",
    });
    const button = (text, act) => {
        const made = element("button", { type: "button", className: "second" }, text);
        made.addEventListener("click", act);
        return made;
    };
    let renderer;
    try {
        renderer = new WebGLRenderer({ canvas, antialias: false });
    } catch {
        throw new Mistake("This browser can't draw scenes.", "Switch WebGL on, or use another browser.");
    }
    const view = element("div", { className: "viewer" }, canvas);
    box.replaceChildren(view);
    renderer.setClearColor(new Color(1, 1, 1), 1);
    const scene = new Scene();
    // As the reference rasteriser draws them, whose pictures marks are made for.
    scene.add(new SparkRenderer({ renderer, preBlurAmount: 0.3, blurAmount: 0, maxStdDev: 3 }));
    const group = new Group();
    // Scenes of captures have y downwards.
    group.quaternion.set(1, 0, 0, 0);
    scene.add(group);
    try {
        for (const { type, bytes, matrix } of await parts(file)) {
            const mesh = new SplatMesh({ fileBytes: bytes, fileType: type });
            matrix?.decompose(mesh.position, mesh.quaternion, mesh.scale);
            group.add(mesh);
        }
        await Promise.all(group.children.map((mesh) => mesh.initialized));
    } catch {
        throw new Mistake("The viewer can't read this kind of file.", "The scene itself is good: download it, or turn it in another viewer.");
    }

    const { centre, radius } = extent(group, Vector3, Box3);
    const camera = new PerspectiveCamera(FIELD_OF_VIEW, 4 / 3, radius / 100, radius * 100);
    const distance = (0.85 * radius) / Math.sin(((FIELD_OF_VIEW / 2) * Math.PI) / 180);
    camera.position.copy(centre).add(new Vector3(0.5, 0.35, 0.8).normalize().multiplyScalar(distance));
    const controls = new OrbitControls(camera, canvas);
    controls.target.copy(centre);
    controls.maxDistance = radius * 20;
    controls.update();

    let [until, asked] = [0, 0];
    const draw = () => {
        asked = 0;
        renderer.render(scene, camera);
        if (performance.now() < until) asked = requestAnimationFrame(draw);
    };
    const wake = () => {
        until = performance.now() + AWAKE;
        asked ||= requestAnimationFrame(draw);
    };
    const size = () => {
        const { clientWidth: width, clientHeight: height } = canvas;
        if (!width || !height) return;
        renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
        renderer.setSize(width, height, false);
        camera.aspect = width / height;
        camera.updateProjectionMatrix();
        wake();
    };
    const turn = (across, up) => {
        const offset = camera.position.clone().sub(controls.target);
        offset.applyAxisAngle(camera.up, across);
        const side = new Vector3().crossVectors(camera.up, offset).normalize();
        const tilted = offset.clone().applyAxisAngle(side, up);
        // Not over the pole, where there is no up.
        if (Math.abs(tilted.clone().normalize().dot(camera.up)) < 0.98) offset.copy(tilted);
        camera.position.copy(controls.target).add(offset);
        controls.update();
        wake();
    };
    const approach = (factor) => {
        camera.position.sub(controls.target).multiplyScalar(factor).add(controls.target);
        controls.update();
        wake();
    };
    const keys = {
        ArrowLeft: () => turn(-STEP, 0),
        ArrowRight: () => turn(STEP, 0),
        ArrowUp: () => turn(0, -STEP),
        ArrowDown: () => turn(0, STEP),
        "+": () => approach(0.85),
        "=": () => approach(0.85),
        "-": () => approach(1 / 0.85),
    };
    canvas.addEventListener("keydown", (event) => {
        const act = event.ctrlKey || event.metaKey || event.altKey ? undefined : keys[event.key];
        if (!act) return;
        event.preventDefault();
        act();
    });
    controls.addEventListener("change", wake);
    const watcher = new ResizeObserver(size);
    watcher.observe(canvas);
    size();

    let number = 0;
    const picture = async () => {
        // As it is when everything is sorted.
        while (performance.now() < until) await new Promise((resolve) => setTimeout(resolve, 100));
        renderer.render(scene, camera);
        const blob = await new Promise((resolve) => canvas.toBlob(resolve, "image/png"));
        const name = `${file.name.replace(/\..*$/, "")}-${++number}.png`;
        announce(`A picture was taken: ${name}`);
        taken(new File([blob], name, { type: "image/png" }));
    };
    view.append(
        element(
            "div",
            { className: "row" },
            button("Turn left", keys.ArrowLeft),
            button("Turn right", keys.ArrowRight),
            button("Higher", keys.ArrowUp),
            button("Lower", keys.ArrowDown),
            button("Nearer", keys["+"]),
            button("Farther", keys["-"]),
            button("Take a picture", picture),
        ),
    );
    return () => {
        watcher.disconnect();
        cancelAnimationFrame(asked);
        controls.dispose();
        for (const mesh of group.children) mesh.dispose();
        renderer.dispose();
        box.replaceChildren();
    };
}

/** Where most of a scene is: a few Gaussians far out are left out, as captures have them. */
function extent(group, Vector3, Box3) {
    const points = [];
    const count = group.children.reduce((sum, mesh) => sum + mesh.packedSplats.numSplats, 0);
    const every = Math.max(1, Math.floor(count / 20_000));
    group.updateMatrixWorld();
    for (const mesh of group.children) {
        mesh.packedSplats.forEachSplat((index, center) => {
            if (index % every === 0) points.push(center.clone().applyMatrix4(mesh.matrixWorld));
        });
    }
    if (points.length === 0) throw new Mistake("The scene is empty.");
    const middle = (values) => values.sort((a, b) => a - b)[values.length >> 1];
    const median = new Vector3(...["x", "y", "z"].map((axis) => middle(points.map((point) => point[axis]))));
    const kept = points.map((point) => [point.distanceTo(median), point]).sort((a, b) => a[0] - b[0]);
    const most = kept.slice(0, Math.ceil(0.97 * kept.length)).map(([, point]) => point);
    const box = new Box3().setFromPoints(most);
    const centre = box.getCenter(new Vector3());
    const radii = most.map((point) => point.distanceTo(centre)).sort((a, b) => a - b);
    const radius = radii[Math.floor(0.98 * (radii.length - 1))] || 1;
    return { centre, radius };
}
