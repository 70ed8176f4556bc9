"""What is known of a vessel beside the frames: datasheet, bottom, vessel file, and the rule of evidence."""
