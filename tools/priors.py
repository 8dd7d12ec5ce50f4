#!/usr/bin/env python3
"""Priors for the images of a capture folder: optical flow and monocular depth.

  priors.py CAPTURE --flow dis                                        OpenCV's DIS, no weights (Debian: python3-opencv)
  priors.py CAPTURE --flow raft --weights raft_large.pth              torchvision's RAFT
  priors.py CAPTURE --flow videoflow --repository VideoFlow --weights MOF_sintel.pth
  priors.py CAPTURE --depth depth-anything --repository Depth-Anything-V2 --encoder vitl --weights depth_anything_v2_vitl.pth

`ivv prepare --flow dis` runs the first. The others need packages and weights that you install yourself; NEITHER RAFT NOR
VIDEOFLOW NOR DEPTH ANYTHING HAS EVER BEEN RUN BY THIS PROJECT'S TESTS, for want of their weights: look at the first files.
After them set flow = true or depth = true in capture.toml, or run `ivv prepare` again, which does so.

Flow goes to flow/<camera>/<frame:05>.npy, halves, from each frame to the next, pixels; NaN where the flow back does not lead to
where it began or the mask is 0. Depth goes to depth/<camera>/<frame:05>.npy, float32, the network's inverse depth.
Files that exist are kept; a line is printed for each one that is written or kept.
"""

import argparse
import os
import sys
from pathlib import Path


def need(module, remedy):
    """The module, or the end of the program with what to install."""
    try:
        return __import__(module, fromlist=["_"])
    except ImportError as error:
        sys.exit(f"{error}: {remedy}")


def write_atomic(path, write):
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    with open(temporary, "wb") as file:
        write(file)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)


def write_flow(path, flow, valid):
    """An array of shape (height, width, 2) of halves, a thirtieth of a pixel and better below 64; NaN where it is not valid."""
    halves = np.where(valid[..., None], flow, np.float32(np.nan)).astype("<f2")
    write_atomic(path, lambda file: np.save(file, halves))


def consistent(forward, backward):
    """Where forward and back leads to the start (after Sundaram, Brox and Keutzer 2010), and the end lies in the picture.

    With a fifth and a tenth of their tolerances: fewer pixels, but what moves is led astray by those that are wrong.
    """
    height, width = forward.shape[:2]
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    end_x, end_y = x + forward[..., 0], y + forward[..., 1]
    back = cv2.remap(backward, end_x, end_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    miss = ((forward + back) ** 2).sum(-1)
    size = (forward**2).sum(-1) + (back**2).sum(-1)
    inside = (end_x >= 0) & (end_x <= width - 1) & (end_y >= 0) & (end_y <= height - 1)
    return inside & (miss < 0.002 * size + 0.05)


def dis(_):
    """Pictures of two frames to flow."""
    estimator = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    # The preset stops at half the resolution.
    estimator.setFinestScale(0)
    grey = lambda picture: cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    return lambda first, second: estimator.calc(grey(first), grey(second), None)


def raft(args):
    torch = need("torch", "pip install torch torchvision")
    models = need("torchvision.models.optical_flow", "pip install torchvision")
    device = "cuda" if torch.cuda.is_available() else "cpu"
    model = models.raft_large(weights=None)
    model.load_state_dict(torch.load(args.weights, map_location="cpu", weights_only=True))
    model = model.to(device).eval()

    def estimate(first, second):
        height, width = first.shape[:2]
        # The network wants sides that are multiples of 8, of at least 128.
        pad = [max(-(-side // 8) * 8, 128) - side for side in (height, width)]
        tensor = lambda p: torch.from_numpy(np.pad(p[..., ::-1], ((0, pad[0]), (0, pad[1]), (0, 0)), "edge").copy())
        batch = lambda p: (tensor(p).permute(2, 0, 1)[None].float() / 127.5 - 1).to(device)
        with torch.no_grad():
            flow = model(batch(first), batch(second))[-1][0]
        return flow.permute(1, 2, 0).cpu().numpy()[:height, :width]

    return estimate


def videoflow(args):
    """Pictures of five frames to the flows of the inner three, forward and back."""
    torch = need("torch", "install what VideoFlow's README says")
    sys.path[:0] = [args.repository, os.path.join(args.repository, "core")]
    remedy = "give VideoFlow's checkout with --repository"
    cfg = need("configs.multiframes_sintel_submission", remedy).get_cfg()
    network = need("core.Networks", remedy).build_network(cfg)
    padder_class = need("utils.utils", remedy).InputPadder
    model = torch.nn.DataParallel(network)
    model.load_state_dict(torch.load(args.weights, map_location="cpu", weights_only=True))
    model = model.module.cuda().eval()

    def estimate(pictures):
        tensors = [torch.from_numpy(p[..., ::-1].copy()).permute(2, 0, 1).float() for p in pictures]
        batch = torch.stack(tensors)[None].cuda()
        padder = padder_class(batch.shape)
        with torch.no_grad():
            flows = padder.unpad(model(padder.pad(batch), {})[0][0]).cpu().permute(0, 2, 3, 1).numpy()
        # Forward flow of the inner frames, then backward flow of the inner frames.
        return flows[: len(pictures) - 2], flows[len(pictures) - 2 :]

    return estimate


def depth_anything(args):
    torch = need("torch", "pip install torch")
    sys.path.insert(0, args.repository or ".")
    package = need("depth_anything_v2.dpt", "give Depth-Anything-V2's checkout with --repository")
    channels = {"vits": [48, 96, 192, 384], "vitb": [96, 192, 384, 768], "vitl": [256, 512, 1024, 1024]}
    features = {"vits": 64, "vitb": 128, "vitl": 256}
    encoder = args.encoder
    model = package.DepthAnythingV2(encoder=encoder, features=features[encoder], out_channels=channels[encoder])
    model.load_state_dict(torch.load(args.weights, map_location="cpu", weights_only=True))
    model = model.to("cuda" if torch.cuda.is_available() else "cpu").eval()
    return model.infer_image


def picture(path):
    # As ivv and COLMAP read them: pixels as they are stored, whatever EXIF says.
    image = cv2.imread(str(path), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        sys.exit(f"{path}: does not decode")
    return image


def finish_flow(target, forward, backward, mask):
    valid = consistent(forward, backward)
    if mask.is_file():
        valid &= cv2.imread(str(mask), cv2.IMREAD_GRAYSCALE) > 0
    write_flow(target, forward, valid)


def camera_flow(args, capture, camera, images, estimate):
    frames = {int(image.stem): image for image in images}
    # A camera may have lost frames.
    for frame in sorted(frame for frame in frames if frame + 1 in frames):
        target = capture / "flow" / camera / f"{frame:05}.npy"
        if not target.is_file() and not target.with_suffix(".flo").is_file():
            mask = capture / "masks" / camera / f"{frame:05}.png"
            if args.flow == "videoflow":
                # The frame is the second of five; beyond the clip its ends are repeated.
                window = [picture(min(frames.items(), key=lambda it: abs(it[0] - frame - k))[1]) for k in range(-1, 4)]
                forward, backward = estimate(window)
                finish_flow(target, forward[0], backward[1], mask)
            else:
                first, second = picture(frames[frame]), picture(frames[frame + 1])
                finish_flow(target, estimate(first, second), estimate(second, first), mask)
        print(f"{camera}/{frame:05}.npy", flush=True)


def camera_depth(capture, camera, images, estimate):
    for image in images:
        target = capture / "depth" / camera / f"{image.stem}.npy"
        if not target.is_file():
            depth = estimate(picture(image)).astype("<f4")
            write_atomic(target, lambda file: np.save(file, depth))
        print(f"{camera}/{image.stem}.npy", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("--flow", choices=["dis", "raft", "videoflow"])
    parser.add_argument("--depth", choices=["depth-anything"])
    parser.add_argument("--cameras", nargs="*", help="names; all of them by default")
    parser.add_argument("--weights", help="file of the network's weights")
    parser.add_argument("--repository", help="checkout of the network's code")
    parser.add_argument("--encoder", default="vitl", choices=["vits", "vitb", "vitl"], help="of Depth Anything")
    args = parser.parse_args()
    if not args.flow and not args.depth:
        parser.error("give --flow or --depth")
    if (args.depth or args.flow != "dis") and not args.weights:
        parser.error("give the network's --weights")
    global cv2, np
    np = need("numpy", "apt-get install python3-numpy, or pip install numpy")
    cv2 = need("cv2", "apt-get install python3-opencv, or pip install opencv-python-headless")
    # `ivv prepare` runs one process per camera.
    cv2.setNumThreads(1)
    folders = sorted(path for path in (args.capture / "images").glob("*") if path.is_dir())
    folders = [path for path in folders if not args.cameras or path.name in args.cameras]
    if not folders:
        sys.exit(f"{args.capture / 'images'}: holds no such camera")
    flow = args.flow and {"dis": dis, "raft": raft, "videoflow": videoflow}[args.flow](args)
    depth = args.depth and depth_anything(args)
    for folder in folders:
        images = sorted(path for path in folder.iterdir() if path.suffix in (".png", ".jpg", ".jpeg"))
        images = [path for path in images if not path.name.startswith(".")]
        if flow:
            camera_flow(args, args.capture, folder.name, images, flow)
        if depth:
            camera_depth(args.capture, folder.name, images, depth)


if __name__ == "__main__":
    main()
