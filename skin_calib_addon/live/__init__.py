"""Readings of the electronics in; frames of a skin out to ROS 2, MCAP files or UDP, at the rate of the readings."""

from .inputs import FileInput, Input, SerialInput, UdpInput
from .loop import run
from .outputs import McapOutput, Output, UdpOutput

__all__ = ["FileInput", "Input", "McapOutput", "Output", "SerialInput", "UdpInput", "UdpOutput", "run"]
