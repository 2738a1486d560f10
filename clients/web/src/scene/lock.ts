import { Vector3 } from "three";

/** How a camera looks at its own target, in units of its own distance when it was aimed. */
export interface Look {
  offset: Vector3;
  pan: Vector3;
}

type Follow = (look: Look) => void;

/** Cameras that turn together: all follow the one that was turned, also those that join later. */
export class CameraLock {
  private readonly followers = new Set<Follow>();

  constructor(public look: Look | null = null) {}

  join(follow: Follow): () => void {
    this.followers.add(follow);
    if (this.look !== null) follow(this.look);
    return () => this.followers.delete(follow);
  }

  share(look: Look, from: Follow): void {
    this.look = look;
    for (const follow of this.followers) if (follow !== from) follow(look);
  }
}
