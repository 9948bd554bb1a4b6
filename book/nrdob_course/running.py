"""Run one notebook so that the result depends on the notebook, the code and the versions alone."""

import os
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import DeadKernelError

__all__ = ["NotebookRuleError", "execute", "kernel_environment"]

METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


STARTS = 3  # of a kernel whose ports another program takes before it does


class NotebookRuleError(Exception):
    """A notebook that does not run, or that breaks a rule which the runner needs."""


def kernel_environment() -> dict[str, str]:
    """Set the environment in which results cannot depend on the reader's own settings."""
    import matplotlib

    return {
        **os.environ,
        "PYTHONHASHSEED": "0",
        # A personal matplotlibrc would change the figures.
        "MATPLOTLIBRC": str(Path(matplotlib.get_data_path()) / "matplotlibrc"),
        # The kernel of this environment, even where the user has registered another "python3".
        "JUPYTER_PREFER_ENV_PATH": "1",
        # Two notebooks run side by side: keep them from fighting for the cores.
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
    }


def copy_alt_text(cell: Any) -> None:
    """Copy the alt text of the cell's figure to where the book looks for it.

    Our figures carry their alt text in the metadata of the output; the book reads it from the
    metadata of the cell, ``mystnb.image.alt``. Caption and name, which the author writes in
    ``mystnb.figure``, stay as they are.
    """
    pictures = [output.get("metadata", {}).get("image/png", {}) for output in cell.outputs]
    alts = [picture["alt"] for picture in pictures if "alt" in picture]
    if len(alts) > 1:
        raise NotebookRuleError(f"cell {cell.id} shows {len(alts)} figures; show one")
    if alts:
        cell.metadata.setdefault("mystnb", {}).setdefault("image", {})["alt"] = alts[0]
    elif "image" in cell.metadata.get("mystnb", {}):
        # The figure is gone or has lost its alt text: an old one must not stay behind.
        cell.metadata["mystnb"]["image"].pop("alt", None)


def drop_widget_views(cell: Any) -> None:
    """Keep the picture of a figure with sliders; its sliders live only as long as the kernel."""
    for output in cell.outputs:
        output.get("data", {}).pop("application/vnd.jupyter.widget-view+json", None)


def execute(path: Path, timeout: int) -> str:
    """Run one notebook from its own folder and give back the text to store.

    Parameters
    ----------
    path : Path
        The notebook; it is read, not written.
    timeout : int
        Seconds that a cell may take.

    Returns
    -------
    str
        The notebook with its outputs.

    Raises
    ------
    NotebookRuleError
        If a cell shows two figures.
    nbclient.exceptions.CellExecutionError, RuntimeError
        If a cell fails; if no kernel starts.
    """
    notebook = nbformat.read(path, as_version=4)
    for start in range(1, STARTS + 1):
        client = NotebookClient(
            notebook,
            timeout=timeout,
            kernel_name="python3",
            record_timing=False,
            store_widget_state=False,
            coalesce_streams=True,  # else one print may be stored in two parts, as the timing falls
            # Else the kernel remarks, each time, that it talks over the loopback unencrypted.
            extra_arguments=["--log-level=ERROR"],
            resources={"metadata": {"path": str(path.parent)}},
        )
        try:
            client.execute(env=kernel_environment())
            break
        except DeadKernelError:  # in a cell
            raise
        except RuntimeError:  # at its start
            if start == STARTS:
                raise
    for cell in notebook.cells:
        if cell.cell_type == "code":
            copy_alt_text(cell)
            drop_widget_views(cell)
    notebook.metadata = nbformat.from_dict(METADATA)
    nbformat.validate(notebook)
    return str(nbformat.writes(notebook)).rstrip("\n") + "\n"
