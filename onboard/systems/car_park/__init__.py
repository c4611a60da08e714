"""The robotized car park of Pujo, Ounnar and Zanni (2006): mobile robots and compartments as holons."""
