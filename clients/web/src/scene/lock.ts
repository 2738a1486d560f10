import { Vector3 } from "three";

/** How a camera looks at its own target, in units of its own distance when it was aimed. */
export interface Look {
  offset: Vector3;
  pan: Vector3;
}

type Follow = (look: Look) => void;

/** Cameras that turn together: what one is told, all others do. */
export class CameraLock {
  private readonly followers = new Set<Follow>();

  join(follow: Follow): () => void {
    this.followers.add(follow);
    return () => this.followers.delete(follow);
  }

  tell(look: Look, from: Follow): void {
    for (const follow of this.followers) if (follow !== from) follow(look);
  }
}
