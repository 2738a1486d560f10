import type { Camera, Scene, WebGLRenderer } from "three";

const FRAMES_PER_S = 25;
const TYPES = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];

/** A drawing, with what it is drawn of; see `Stage`. */
type Drawn = HTMLCanvasElement & { gl?: WebGLRenderer; scene?: Scene; camera?: Camera };

/** What is drawn now, as a PNG. */
export async function pictureOf(canvas: Drawn): Promise<Blob> {
  // What was drawn before is gone from the buffer, so it is drawn once more.
  if (canvas.gl !== undefined && canvas.scene !== undefined && canvas.camera !== undefined) {
    canvas.gl.render(canvas.scene, canvas.camera);
  }
  return new Promise((resolve, reject) => {
    canvas.toBlob((blob) => {
      if (blob === null) reject(new Error("nothing is drawn"));
      else resolve(blob);
    }, "image/png");
  });
}

/**
 * What is drawn from now on, as a WebM, until it is stopped.
 *
 * @param begun - Told how to stop it.
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

/** HTML that shows a moment of a job's trial in a frame of another page. */
export function embedding(address: string): string {
  const source = address.replace("/jobs/", "/embed/job/").replaceAll("&", "&amp;").replaceAll('"', "%22");
  return `<iframe src="${source}" title="A trial of BuildArena" width="760" height="720" style="border: 0" loading="lazy"></iframe>`;
}
