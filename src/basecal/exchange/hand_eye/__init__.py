"""What hand-eye programs recorded, each as it means its poses."""
