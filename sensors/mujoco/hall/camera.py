"""A forward camera: rendering by MuJoCo in software, and the sensor's exposure, blur, vignette and noise."""

from math import atan, cos, degrees, sin, tan

import cv2
import mujoco
import numpy as np

from .robot import Mount

#: Mean gray level that the automatic exposure aims at, its bounds, and the share of the error that it removes per frame.
TARGET_LEVEL, MIN_GAIN, MAX_GAIN, EXPOSURE_RATE = 115.0, 0.6, 1.8, 0.25
BLUR_SIGMA_PX = 0.55
#: Loss of light half the image's width and height from its center, per unit of squared distance.
VIGNETTE = 0.10
#: Variance of the noise: read noise, and shot noise per gray level.
READ_VARIANCE, SHOT_VARIANCE = 2.0, 0.03


class Camera:
    """A camera in a world. `exposure` is the gain of its automatic exposure."""

    def __init__(self, model: mujoco.MjModel, mount: Mount):
        self.model, self.mount = model, mount
        self.exposure, self._tint = 1.0, np.ones(3)
        self._noise = np.random.default_rng(0)
        self._eye, self._robot = model.camera("eye").id, model.body("robot").id
        self._fov_y_deg = degrees(2 * atan(tan(mount.fov_rad / 2) * mount.height_px / mount.width_px))
        self._renderer: mujoco.Renderer | None = None
        self._visible = mujoco.MjvOption()
        self._visible.geomgroup[:] = [1, 1, 1, 1, 0, 0]
        rows, columns = np.ogrid[-1 : 1 : mount.height_px * 1j, -1 : 1 : mount.width_px * 1j]
        self._vignette = (1 - VIGNETTE * (columns * columns + rows * rows)).astype(np.float32)[..., None]

    def reset(self, tint: np.ndarray, noise: np.random.Generator) -> None:
        """Begins a run with a gain of each color channel and a source of noise."""
        self.exposure, self._tint, self._noise = 1.0, tint, noise

    def image(self, data: mujoco.MjData) -> np.ndarray:
        """Returns the image of the current state: (height, width, 3), RGB, 8 bits."""
        self._aim(data)
        if self._renderer is None:
            self._renderer = mujoco.Renderer(self.model, self.mount.height_px, self.mount.width_px)
        self._renderer.update_scene(data, "eye", self._visible)
        return self._sense(self._renderer.render())

    def close(self) -> None:
        """Releases the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _aim(self, data: mujoco.MjData) -> None:
        """Moves MuJoCo's camera, which looks along its -z with y up, to the mount on the robot."""
        position, robot = data.xpos[self._robot], data.xmat[self._robot].reshape(3, 3)
        tilt = self.mount.tilt_rad
        backward = -(robot @ [cos(tilt), 0, -sin(tilt)])
        backward = backward / np.linalg.norm(backward)
        right = np.cross(robot @ [sin(tilt), 0, cos(tilt)], backward)
        right /= np.linalg.norm(right)
        axes = np.column_stack([right, np.cross(backward, right), backward])
        mujoco.mju_mat2Quat(self.model.cam_quat[self._eye], axes.ravel())
        self.model.cam_pos[self._eye] = position + robot @ [self.mount.x_m, 0, self.mount.z_m]
        self.model.cam_fovy[self._eye] = self._fov_y_deg
        mujoco.mj_camlight(self.model, data)

    def _sense(self, rendered: np.ndarray) -> np.ndarray:
        lit = np.count_nonzero(rendered[..., 0] | rendered[..., 1] | rendered[..., 2])
        mean = sum(cv2.sumElems(rendered)[:3]) / (3 * lit) if lit else 110.0
        self.exposure += EXPOSURE_RATE * (min(max(TARGET_LEVEL / max(mean, 1.0), MIN_GAIN), MAX_GAIN) - self.exposure)
        gain = (self.exposure * self._tint).astype(np.float32)
        image = cv2.GaussianBlur(rendered.astype(np.float32), (0, 0), BLUR_SIGMA_PX) * (self._vignette * gain)
        sigma = np.sqrt(READ_VARIANCE + SHOT_VARIANCE * np.maximum(image, 0))
        image += sigma * self._noise.standard_normal(image.shape, np.float32)
        return np.clip(image, 0, 255).astype(np.uint8)
