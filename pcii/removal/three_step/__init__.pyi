from .three_step_method import ThreeStep as ThreeStep
