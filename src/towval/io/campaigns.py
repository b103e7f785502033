"""Several campaigns at once."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from towval.io.campaign import Campaign, load_campaign
from towval.model.errors import InputError


class Campaigns(Mapping[str, Campaign]):
    """Campaigns by name, in the order of their folders; each is read and checked when it is first asked for.

    Raises `InputError` for two folders of one name, and what :func:`towval.io.campaign.load_campaign` raises.
    """

    def __init__(self, folders: Iterable[str | Path]) -> None:
        self._folders: dict[str, Path] = {}
        self._read: dict[str, Campaign] = {}
        for folder in map(Path, folders):
            name = folder.resolve().name
            if name in self._folders:
                raise InputError(f"two campaigns have the folder name {name}", remedy="rename one folder")
            self._folders[name] = folder

    def __getitem__(self, name: str) -> Campaign:
        if name not in self._read:
            self._read[name] = load_campaign(self._folders[name])
        return self._read[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._folders)

    def __len__(self) -> int:
        return len(self._folders)
