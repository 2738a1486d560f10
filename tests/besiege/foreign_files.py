"""Machine files as other projects write them."""

from buildarena_besiege import read_machine_file

FOREIGN = """<?xml version="1.0" encoding="utf-8"?>
<Machine version="1" bsgVersion="{version}" name="gpt">
  <Global><Position x="0" y="5.05" z="0"/><Rotation x="0" y="0" z="0" w="1"/></Global>
  <Data>{data}</Data>
  <Blocks>
    <Block id="0" guid="a1"><Transform><Position x="0" y="0" z="0"/>
      <Rotation x="0" y="0" z="0" w="1"/><Scale x="1" y="1" z="1"/></Transform>
      <Data><Integer key="bmt-version">1</Integer></Data></Block>
    <Block id="15" guid="a2"><Transform><Position x="0" y="0" z="0.5"/>
      <Rotation x="0" y="0" z="0" w="1"/><Scale x="1" y="1" z="1"/></Transform>
      <Data>None</Data></Block>
    {blocks}
  </Blocks>
</Machine>
"""


def foreign(blocks: str = "", data: str = '<StringArray key="requiredMods" />', version="1.3"):
    return read_machine_file(FOREIGN.format(blocks=blocks, data=data, version=version).encode())


def block(kind: int, place: str = 'x="0" y="0" z="1.5"', data: str = "", scale: str = "1") -> str:
    return (
        f'<Block id="{kind}" guid="b{kind}"><Transform><Position {place}/>'
        f'<Rotation x="0" y="0" z="0" w="1"/><Scale x="{scale}" y="1" z="1"/></Transform>'
        f"<Data>{data}</Data></Block>"
    )
