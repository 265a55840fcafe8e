"""Rules of repetition: wallpaper groups, tilings, mirrors, borders."""
