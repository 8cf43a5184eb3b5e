from .camera import Camera
from .hidden import hidden_stretch
from .rope import RopeEstimate, rope
from .cloth import ClothEstimate, cloth
