"""Several campaigns at once."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from towval.io.campaign import Campaign, load_campaign
from towval.model.errors import Faults, InputError


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

    def check(self) -> None:
        """Read all campaigns.

        Raises `InputError` for their faults, all at once; where there are several campaigns, each with its name.
        """
        faults = Faults()
        for name in self:
            try:
                self[name]
            except InputError as error:
                faults.append(error if len(self) == 1 else InputError(f"{name}: {error}"))
        faults.raise_any("the list of campaigns")

    def __getitem__(self, name: str) -> Campaign:
        if name not in self._read:
            self._read[name] = load_campaign(self._folders[name])
        return self._read[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._folders)

    def __len__(self) -> int:
        return len(self._folders)
