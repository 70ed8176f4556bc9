"""Where tasks run: processes of this machine, Ray, or workers that share nothing but the run's place."""
