from cli.test_serve import grasp, when_served

__all__ = ["grasp", "when_served"]
