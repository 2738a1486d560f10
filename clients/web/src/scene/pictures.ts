import type { Camera, Scene, WebGLRenderer } from "three";

const FRAMES_PER_S = 25;
const TYPES = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];

/** A drawing, with what it is drawn of; see `Stage`. */
type Drawn = HTMLCanvasElement & { gl?: WebGLRenderer; scene?: Scene; camera?: Camera };

/** As large as links are shown with. */
const [WIDTH, HEIGHT] = [1200, 630];
const MARGIN = 36;

/** What is drawn now with a caption at its foot, as a PNG. */
export async function pictureOf(canvas: Drawn, [title = "", ...more]: readonly string[]): Promise<Blob> {
  // What was drawn before is gone from the buffer, so it is drawn once more.
  if (canvas.gl !== undefined && canvas.scene !== undefined && canvas.camera !== undefined) {
    canvas.gl.render(canvas.scene, canvas.camera);
  }
  const picture = Object.assign(document.createElement("canvas"), { width: WIDTH, height: HEIGHT });
  const context = picture.getContext("2d");
  if (context === null) throw new Error("this browser draws no pictures");
  context.fillStyle = "#e9ebe9";
  context.fillRect(0, 0, WIDTH, HEIGHT);
  const scale = Math.max(WIDTH / canvas.width, HEIGHT / canvas.height);
  const [width, height] = [canvas.width * scale, canvas.height * scale];
  context.drawImage(canvas, (WIDTH - width) / 2, (HEIGHT - height) / 2, width, height);
  const foot = MARGIN + 48 + 34 * more.length;
  context.fillStyle = "rgb(16 20 24 / 78%)";
  context.fillRect(0, HEIGHT - foot, WIDTH, foot);
  context.fillStyle = "#fff";
  [title, ...more].forEach((line, at) => {
    context.font = `${at === 0 ? "600 34px" : "24px"} system-ui, sans-serif`;
    context.fillText(line, MARGIN, HEIGHT - foot + 52 + 38 * at, WIDTH - 2 * MARGIN);
  });
  return new Promise((resolve, reject) => {
    picture.toBlob((blob) => {
      if (blob === null) reject(new Error("nothing is drawn"));
      else resolve(blob);
    }, "image/png");
  });
}

/**
 * What is drawn from now on, as a WebM, until it is stopped.
 *
 * @param begun - Called with a function that stops it.
 */
export async function filmOf(canvas: Drawn, begun: (stop: () => void) => void): Promise<Blob> {
  const type = TYPES.find((known) => MediaRecorder.isTypeSupported(known));
  const recorder = new MediaRecorder(canvas.captureStream(FRAMES_PER_S), { mimeType: type });
  const pieces: Blob[] = [];
  recorder.addEventListener("dataavailable", (event) => {
    pieces.push(event.data);
  });
  return new Promise((resolve, reject) => {
    recorder.addEventListener("stop", () => {
      resolve(new Blob(pieces, { type: "video/webm" }));
    });
    recorder.addEventListener("error", () => {
      reject(new Error("the film was not recorded"));
    });
    recorder.start(1000);
    begun(() => {
      recorder.stop();
    });
  });
}
