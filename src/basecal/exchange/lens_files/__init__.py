"""Files of lenses, each as the program that wrote it means them."""
